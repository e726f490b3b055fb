#include "stellate/client.h"

#include <optional>
#include <utility>

#include "run/declare.h"
#include "run/host.h"
#include "run/run.h"
#include "shared/auto.h"
#include "stellate/monitor.h"

namespace stellate {

Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options) {
  const Expected<client::Host> host = client::Host::Find(options.connection);
  if (!host) return tl::unexpected(host.error());
  Expected<client::Request> request = client::Settle(*host, oracle, options);
  if (!request) return tl::unexpected(request.error());
  for (int retries = options.epsilon == kAuto ? automatic::kRetries : 0;; --retries) {
    client::Run run(host->channel, oracle, request->options, host->IsHopeless());
    Expected<Mesh> mesh = run.Go();
    if (!mesh) return mesh;
    client::Tell(request->epsilon_reason, &mesh->report);
    const bool goes_on = retries > 0 && mesh->report.finer && !options.stop.stop_requested();
    if (!goes_on) return mesh;
    client::Take(*mesh->report.finer, &*request);
  }
}

Expected<ServerHealth> CheckHealth(const Connection& connection, Seconds timeout) {
  Expected<Monitor> monitor = Monitor::Connect(connection);
  if (!monitor) return tl::unexpected(monitor.error());
  return monitor->Health(timeout);
}

}  // namespace stellate
