#include "server/base/version.h"

#include <grpcpp/grpcpp.h>

#include "core/base/message.h"

namespace stellate::server {

const char* Version() { return STELLATE_VERSION; }

std::string VersionLine() {
  return core::Message("stellated ", Version(), " (gRPC ", grpc::Version(), ")");
}

}  // namespace stellate::server
