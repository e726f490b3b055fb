#pragma once

#include <string>

#include "core/status.h"

namespace stellate::server {

// Where to listen: a TCP host and port, or a unix socket.
struct ListenAddress {
  std::string unix_path;  // set: a unix socket
  std::string host;       // brackets taken off
  int port = 0;           // 0: any free one

  bool IsUnix() const { return !unix_path.empty(); }
  bool IsLoopback() const;     // reachable from this machine alone
  bool IsEvery() const;        // all addresses of this machine
  std::string Target() const;  // as gRPC writes it
};

// "host:port", "[v6]:port", "unix:/path". `flag` is what a refusal names.
core::Expected<ListenAddress> ParseListenAddress(const std::string& text,
                                                 const std::string& flag = "--listen");

}  // namespace stellate::server
