// gRPC as it is, where nothing of it can be replaced or watched.

#include <grpcpp/grpcpp.h>

#include "server/grpc_parts/header_bound.h"
#include "server/grpc_parts/unread.h"

namespace stellate::server {

bool HeaderBlocksEnd() { return !LacksHeaderBound(grpc::Version()); }
bool CountsUnread() { return false; }

}  // namespace stellate::server
