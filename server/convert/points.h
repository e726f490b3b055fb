#pragma once

#include "core/status.h"
#include "server/base/refusal.h"
#include "server/config/config.h"
#include "server/points/point_intake.h"
#include "server/session/mesh_request.h"
#include "stellate/v1/mesh.pb.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::server {

// As of a MeshSpec (server/convert/spec.h): fills in every default and checks every limit of the
// server. core::Validate accepts the result's `points`.
Allowed<MeshRequest> FromProto(const v1::Reconstruction& spec, const Config& config);
// `spec`: of a mesh that was declared so.
void ToProto(const PointsRequest& points, v1::MeshSpec* spec);

// kInvalidArgument: an array has another shape.
core::Expected<PointsPart> FromProto(const v1::Points& points, const PointsRequest& request);

void ToProto(const core::ReconstructionCounts& counts, v1::ReconstructionReport* out);

}  // namespace stellate::server
