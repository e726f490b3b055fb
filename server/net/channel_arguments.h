#pragma once

#include <grpcpp/server_builder.h>

#include "server/config/config.h"

namespace stellate::server {

// What gRPC is told of sizes, times and numbers: all that bounds a connection.
void SetChannelArguments(const Config& config, grpc::ServerBuilder* builder);

}  // namespace stellate::server
