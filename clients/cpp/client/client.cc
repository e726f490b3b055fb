#include "stellate/client.h"

#include <memory>

#include "channel.h"
#include "embedded_server.h"
#include "run.h"
#include "stellate/monitor.h"

namespace stellate {

Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options) {
  std::unique_ptr<client::EmbeddedServer> embedded;
  std::string server = options.server;
  if (server.empty()) {
    auto started = client::EmbeddedServer::Start();
    if (!started) return tl::unexpected(started.error());
    embedded = std::move(*started);
    server = embedded->address();
  }
  // One's own server on the same machine needs no pings: its end shows at once.
  const auto channel =
      embedded ? client::Connect(server, {}, client::kNoPings)
               : client::Connect(server, options.credentials, options.keepalive_seconds);
  if (!channel) return tl::unexpected(channel.error());
  MeshOptions effective = options;
  // Round trips are what a far server costs.
  if (!options.ask_ahead && !client::StaysOnThisMachine(server)) effective.ask_ahead = true;
  client::Run run(*channel, oracle, effective,
                  [&embedded] { return embedded && !embedded->alive(); });
  return run.Go();
}

Expected<ServerHealth> CheckHealth(const std::string& server, double timeout_seconds,
                                   const Credentials& credentials) {
  Expected<Monitor> monitor = Monitor::Connect(server, credentials);
  if (!monitor) return tl::unexpected(monitor.error());
  return monitor->Health(timeout_seconds);
}

}  // namespace stellate
