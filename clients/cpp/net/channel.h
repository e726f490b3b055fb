#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <memory>
#include <string>

#include "stellate/connection.h"
#include "stellate/error.h"

namespace stellate::client {

// A channel to connection.server that sends the token, if there is one, with every call. kRefused:
// a file that cannot be read, or a token that others could read on its way.
inline constexpr Seconds kNoPings{1e6};  // as Connection::keepalive
Expected<std::shared_ptr<grpc::Channel>> Connect(const Connection& connection);

// For a unary call, connecting included.
extern const std::chrono::milliseconds kCallTime;

// Keeps gRPC's threads until the process ends: its shutdown, which follows the last channel or
// server, now and then waits for ten seconds.
void KeepGrpc();

// Whether a server's address is a unix socket or the loopback.
bool StaysOnThisMachine(const std::string& server);

}  // namespace stellate::client
