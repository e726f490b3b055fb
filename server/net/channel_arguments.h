#pragma once

#include <grpcpp/server_builder.h>

#include "server/config/config.h"

namespace stellate::server {

// Sets gRPC's limits of a connection: sizes, times and numbers of calls.
void SetChannelArguments(const Config& config, grpc::ServerBuilder* builder);

}  // namespace stellate::server
