#include "server/convert/mesh.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {

grpc::Status GetMesh(const Call& call, const v1::GetMeshRequest& request, v1::Mesh* mesh) {
  const auto session = FindMesh(call.state, call.caller, request.name());
  if (!session) return session.error();
  ShowMesh(call, **session, mesh);
  if (request.worker_stats()) ToProto((*session)->pool().ListWorkers(), mesh);
  if (request.has_past_progress_after())
    ToProto((*session)->history().PastAfter(request.past_progress_after()), mesh);
  return grpc::Status::OK;
}

}  // namespace stellate::server
