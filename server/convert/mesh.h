#pragma once

#include <vector>

#include "core/orientation.h"
#include "core/report.h"
#include "server/history/mesh_history.h"
#include "server/session/session.h"
#include "stellate/v1/mesh.pb.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::server {

v1::MeshState ToProto(SessionState state);
v1::Phase ToProto(core::Phase phase);
v1::Termination ToProto(core::Termination termination);

void ToProto(const SessionView& view, v1::Progress* out);
void ToProto(const core::Report& report, int k, v1::Report* out);
// Add to a mesh's state.
void ToProto(const std::vector<WorkerStats>& workers, v1::Mesh* out);
void ToProto(const std::vector<PastProgress>& past, v1::Mesh* out);
// State, progress and report; no geometry, neither the mesh's nor the seeds'.
void ToProto(const Session& session, v1::Mesh* out);
// The same of a mesh that no session has.
void ToProto(const MeshRequest& request, const SessionView& view, v1::Mesh* out);
// `d`: ambient dimension; `k`: dimension.
void ToProto(const DeltaPart& part, int k, int d, v1::DeltaChunk* out);
// For a download: nothing is removed.
void ToProto(const DeltaPart& part, int k, int d, v1::DownloadMeshResponse* out);

// A chunk of the orientation, of `max_bytes` at most. Returns where the next one begins.
std::size_t ToProto(const core::Orientation& orientation, std::size_t first_byte,
                    std::size_t max_bytes, v1::Orientation* out);

}  // namespace stellate::server
