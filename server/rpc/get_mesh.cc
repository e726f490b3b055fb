#include "server/convert/mesh.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {

grpc::Status GetMesh(const Call& call, const v1::GetMeshRequest& request, v1::Mesh* mesh) {
  const auto session = FindMesh(call.state, call.caller, request.name());
  if (!session) return session.error();
  ToProto(**session, mesh);
  return grpc::Status::OK;
}

}  // namespace stellate::server
