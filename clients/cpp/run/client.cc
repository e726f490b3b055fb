#include "stellate/client.h"

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "net/channel.h"
#include "net/embedded_server.h"
#include "run/declare.h"
#include "run/epsilon.h"
#include "run/run.h"
#include "shared/doctor.h"
#include "stellate/monitor.h"

namespace stellate {

Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options) {
  Expected<client::Request> request = client::Settle(oracle, options);
  if (!request) return tl::unexpected(request.error());
  std::unique_ptr<client::EmbeddedServer> embedded;
  Connection connection = options.connection;
  if (connection.server.empty()) {
    auto started = client::EmbeddedServer::Start();
    if (!started) return tl::unexpected(started.error());
    embedded = std::move(*started);
    connection.server = embedded->address();
    connection.credentials = {};
    // Pings would show nothing: the end of one's own server shows immediately.
    connection.keepalive = client::kNoPings;
  }
  const auto channel = client::Connect(connection);
  if (!channel) return tl::unexpected(channel.error());
  for (int retries = options.epsilon == kAuto ? doctor::kAutoRetries : 0;; --retries) {
    client::Run run(*channel, oracle, request->options,
                    [&embedded] { return embedded && !embedded->alive(); });
    Expected<Mesh> mesh = run.Go();
    if (!mesh) return mesh;
    client::Tell(request->epsilon_reason, &mesh->report);
    if (retries == 0 || options.stop.stop_requested()) return mesh;
    const std::optional<ChosenEpsilon> finer = client::Finer(mesh->report);
    if (!finer) return mesh;
    client::Take(*finer, &*request);
  }
}

Expected<ServerHealth> CheckHealth(const Connection& connection, Seconds timeout) {
  Expected<Monitor> monitor = Monitor::Connect(connection);
  if (!monitor) return tl::unexpected(monitor.error());
  return monitor->Health(timeout);
}

}  // namespace stellate
