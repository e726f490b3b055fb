#pragma once

#include "core/specification.h"
#include "server/base/refusal.h"
#include "server/config/config.h"
#include "server/session/mesh_request.h"
#include "stellate/v1/mesh.pb.h"

namespace stellate::server {

// A MeshSpec with every default filled in and every limit of the server checked; without a name and
// an owner. Errors: kInvalidArgument or kLimitExceeded, the message starting with the field's path
// in MeshSpec. What it lets through core::Validate accepts too.
Allowed<MeshRequest> FromProto(const v1::MeshSpec& spec, const Config& config);

// Without the seeds: there may be many, and the client that needs them sent them.
void ToProto(const core::Specification& spec, v1::MeshSpec* out);

}  // namespace stellate::server
