#include "server/handlers/handlers.h"

namespace stellate::server {

grpc::Status DeleteMesh(ServerState& service, const v1::DeleteMeshRequest& request,
                        google::protobuf::Empty*) {
  const auto session = FindMesh(service, request.name());
  if (!session) return session.error();
  service.store.Delete(request.name());  // gone already: someone else was quicker
  return grpc::Status::OK;
}

}  // namespace stellate::server
