#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace stellate::server {

// gRPC's statistics of this process's connections, its "channelz", read without the service.

// A connection's number in channelz; never used twice.
using ConnectionId = std::intptr_t;

// Calls `take` for each connection to a gRPC server of this process, with its peer as of PeerOf and
// its id.
void ForEachConnection(const std::function<void(std::string_view, ConnectionId)>& take);

// Whether a connection was accepted at this port: peers of two servers may have the same address.
bool CameToPort(int port, ConnectionId id);

// The number of calls of a connection, open or closed, for which gRPC still has memory. Nothing:
// the connection is gone, and there are none.
std::optional<std::size_t> CallsHeld(ConnectionId id);

// The peer of a TCP connection, as gRPC writes it: "ipv4:1.2.3.4:5", "ipv6:%5B::1%5D:5".
// Empty: it is not connected.
std::string PeerOf(int fd);

}  // namespace stellate::server
