#pragma once

#include "core/specification.h"
#include "server/base/refusal.h"
#include "server/config/config.h"
#include "server/session/mesh_request.h"
#include "stellate/v1/mesh.pb.h"

namespace stellate::server {

// Fills in every default of a MeshSpec and checks every limit of the server; the result has no name
// and no owner yet. Errors: kInvalidArgument or kLimitExceeded, with a message that starts with the
// field's path in MeshSpec. core::Validate accepts the result.
Allowed<MeshRequest> FromProto(const v1::MeshSpec& spec, const Config& config);

// The same without core::Validate: its result may make no sense as a mesh.
Allowed<MeshRequest> ReadSpec(const v1::MeshSpec& spec, const Config& config);

// What a reconstruction has in common with that: dimensions, label, times, and its number of points
// as that of vertices.
Refused ReadCommon(const v1::Reconstruction& spec, const Config& config, MeshRequest* out);

// Without the seeds: there may be many, and the client that needs them sent them.
void ToProto(const core::Specification& spec, v1::MeshSpec* out);

}  // namespace stellate::server
