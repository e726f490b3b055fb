#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace stellate::server {

// What gRPC counts of this process's connections: its "channelz", read without the service.

// By which channelz knows a connection; no other ever gets the same.
using ConnectionId = std::intptr_t;

// Every connection to a gRPC server of this process: its other end, as PeerOf says, and its id.
void ForEachConnection(const std::function<void(std::string_view, ConnectionId)>& take);

// Two servers may have clients that write from the same port.
bool CameToPort(int port, ConnectionId id);

// The calls of a connection that gRPC has not let go of: open, or over and with memory still;
// also of a connection that is closed. Nothing: there are none, and the connection is gone.
std::optional<std::size_t> CallsHeld(ConnectionId id);

// The other end of a TCP connection, as gRPC writes it: "ipv4:1.2.3.4:5", "ipv6:%5B::1%5D:5".
// Empty: it is not connected.
std::string PeerOf(int fd);

}  // namespace stellate::server
