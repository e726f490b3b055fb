#include "stellate/client.h"

#include <optional>
#include <utility>

#include "run/declare.h"
#include "run/epsilon.h"
#include "run/host.h"
#include "run/run.h"
#include "shared/doctor.h"
#include "stellate/monitor.h"

namespace stellate {

Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options) {
  const Expected<client::Host> host = client::Host::Find(options.connection);
  if (!host) return tl::unexpected(host.error());
  Expected<client::Request> request = client::Settle(*host, oracle, options);
  if (!request) return tl::unexpected(request.error());
  for (int retries = options.epsilon == kAuto ? doctor::kAutoRetries : 0;; --retries) {
    client::Run run(host->channel, oracle, request->options, host->IsHopeless());
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
