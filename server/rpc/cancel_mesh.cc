#include "server/convert/mesh.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {

grpc::Status CancelMesh(const Call& call, const v1::CancelMeshRequest& request, v1::Mesh* mesh) {
  const auto session = FindMesh(call.state, call.caller, request.name());
  if (!session) return session.error();
  Audit(**session, call.caller, call.peer, "cancel");
  (*session)->Cancel();
  ShowMesh(call, **session, mesh);
  return grpc::Status::OK;
}

}  // namespace stellate::server
