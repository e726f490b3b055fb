#pragma once

#include <grpcpp/channel.h>

#include <functional>
#include <memory>

#include "net/embedded_server.h"
#include "stellate/connection.h"
#include "stellate/error.h"

namespace stellate::client {

// The server of a call: the one that was named, or a private one that stops with this.
struct Host {
  // connection.server empty: starts one.
  static Expected<Host> Find(const Connection& connection);

  // Whether a server that was lost will not come back.
  std::function<bool()> IsHopeless() const;

  std::unique_ptr<EmbeddedServer> embedded;  // may be null
  Connection connection;                     // to it
  std::shared_ptr<grpc::Channel> channel;
};

}  // namespace stellate::client
