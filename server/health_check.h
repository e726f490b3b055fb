#pragma once

#include <chrono>
#include <string>

namespace stellate::server {

// Asks the server at `target` ("127.0.0.1:7717", "unix:/path") by the gRPC health protocol whether
// it serves. Returns an empty string if so, else what is wrong.
std::string CheckHealth(const std::string& target, std::chrono::milliseconds limit);

}  // namespace stellate::server
