#include "run/host.h"

#include <utility>

#include "net/channel.h"

namespace stellate::client {

Expected<Host> Host::Find(const Connection& connection) {
  Host host;
  host.connection = connection;
  if (connection.server.empty()) {
    auto started = EmbeddedServer::Start();
    if (!started) return tl::unexpected(started.error());
    host.embedded = std::move(*started);
    host.connection.server = host.embedded->address();
    host.connection.credentials = {};
    // Pings would show nothing: the end of one's own server shows immediately.
    host.connection.keepalive = kNoPings;
  }
  auto channel = Connect(host.connection);
  if (!channel) return tl::unexpected(channel.error());
  host.channel = std::move(*channel);
  return host;
}

std::function<bool()> Host::IsHopeless() const {
  return [server = embedded.get()] { return server != nullptr && !server->alive(); };
}

}  // namespace stellate::client
