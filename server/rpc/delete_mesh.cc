#include "server/rpc/rpcs.h"

namespace stellate::server {

grpc::Status DeleteMesh(const Call& call, const v1::DeleteMeshRequest& request,
                        google::protobuf::Empty*) {
  const auto session = FindMesh(call.state, call.caller, request.name());
  if (!session) return session.error();
  Audit(**session, call.caller, call.peer, "delete");
  call.state.store.Delete(request.name());  // gone already: someone else was quicker
  return grpc::Status::OK;
}

}  // namespace stellate::server
