#pragma once

#include <grpcpp/security/credentials.h>

#include <chrono>
#include <memory>
#include <string>

namespace stellate::server {

// Asks the server at `target` ("127.0.0.1:7717", "unix:/path") by the gRPC health protocol whether
// it serves: as a whole, or one service of it. Returns an empty string if so, else what is wrong.
std::string CheckHealth(const std::string& target, std::chrono::milliseconds limit,
                        const std::shared_ptr<grpc::ChannelCredentials>& credentials =
                            grpc::InsecureChannelCredentials(),
                        const std::string& service = "");

}  // namespace stellate::server
