#include "stellate/client.h"

#include <memory>
#include <string>
#include <utility>

#include "net/channel.h"
#include "net/embedded_server.h"
#include "run/run.h"
#include "stellate/monitor.h"

namespace stellate {

Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options) {
  MeshOptions effective = options;
  std::string epsilon_reason;
  if (options.auto_epsilon) {
    if (options.epsilon != 0) {
      return Fail(ErrorCode::kRefused, "epsilon is given and auto_epsilon set: choose one");
    }
    Expected<ChosenEpsilon> chosen = ChooseEpsilon(oracle);
    if (!chosen) return tl::unexpected(chosen.error());
    effective.epsilon = chosen->epsilon;
    epsilon_reason = std::move(chosen->reason);
    if (options.on_epsilon) options.on_epsilon(effective.epsilon, epsilon_reason);
  }
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
  // Round trips are what a far server costs.
  if (!options.ask_ahead && !client::StaysOnThisMachine(server)) effective.ask_ahead = true;
  client::Run run(*channel, oracle, effective,
                  [&embedded] { return embedded && !embedded->alive(); });
  Expected<Mesh> mesh = run.Go();
  if (mesh) mesh->report.epsilon_reason = std::move(epsilon_reason);
  return mesh;
}

Expected<ServerHealth> CheckHealth(const std::string& server, double timeout_seconds,
                                   const Credentials& credentials) {
  Expected<Monitor> monitor = Monitor::Connect(server, credentials);
  if (!monitor) return tl::unexpected(monitor.error());
  return monitor->Health(timeout_seconds);
}

}  // namespace stellate
