#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <memory>
#include <string>

#include "stellate/client.h"
#include "stellate/error.h"

namespace stellate::client {

// A channel to the server that sends the token, if there is one, with every call. A server that was
// silent for `keepalive_seconds` is pinged, and counts as lost when it takes twice as long to
// answer. kRefused: a file that cannot be read, or a token that others could read on its way.
extern const double kUsualKeepalive;
inline constexpr double kNoPings = 1e6;
Expected<std::shared_ptr<grpc::Channel>> Connect(const std::string& server,
                                                 const Credentials& credentials,
                                                 double keepalive_seconds = kUsualKeepalive);

// For a unary call, connecting included.
extern const std::chrono::milliseconds kCallTime;

// Keeps gRPC's threads until the process ends: its shutdown, which follows the last channel or
// server, now and then waits for ten seconds.
void KeepGrpc();

// Whether a server's address is a unix socket or the loopback.
bool StaysOnThisMachine(const std::string& server);

}  // namespace stellate::client
