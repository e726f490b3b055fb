#include "stellate/client.h"

#include <optional>
#include <utility>

#include "run/declare.h"
#include "run/host.h"
#include "run/run.h"
#include "run/scaled.h"
#include "shared/auto.h"
#include "stellate/monitor.h"

namespace stellate {

namespace {

// Meshes, again and finer where epsilon was to be chosen, and gives the last mesh to `deliver`,
// while the server has it.
template <typename Result, typename Deliver>
Expected<Result> Repeat(Oracle& own, const MeshOptions& options, client::Run::Watching watching,
                        const Deliver& deliver) {
  const Expected<std::shared_ptr<Oracle>> scaled = client::Scaled(own, options);
  if (!scaled) return tl::unexpected(scaled.error());
  Oracle& oracle = **scaled;
  const Expected<client::Host> host = client::Host::Find(options.connection);
  if (!host) return tl::unexpected(host.error());
  Expected<client::Request> request = client::Settle(*host, oracle, options);
  if (!request) return tl::unexpected(request.error());
  for (int retries = options.epsilon.length() ? 0 : automatic::kRetries;; --retries) {
    client::Run run(host->channel, oracle, request->options, host->IsHopeless(), watching);
    Expected<Mesh> mesh = run.Go();
    if (!mesh) return tl::unexpected(mesh.error());
    const bool goes_on = retries > 0 && mesh->report.finer && !options.stop.stop_requested();
    if (goes_on) {
      client::Take(*mesh->report.finer, &*request);
      continue;
    }
    Expected<Result> result = deliver(run, std::move(*mesh));
    if (result) client::Tell(request->epsilon_reason, &result->report);
    return result;
  }
}

}  // namespace

Expected<Mesh> MeshManifold(Oracle& oracle, const MeshOptions& options) {
  return Repeat<Mesh>(oracle, options, client::Run::Watching::kMesh,
                      [](client::Run&, Mesh&& mesh) -> Expected<Mesh> { return std::move(mesh); });
}

Expected<SavedMesh> MeshManifoldTo(Oracle& oracle, const std::vector<std::string>& paths,
                                   const MeshOptions& options) {
  const int k = oracle.dimension() - (options.boundary_only.value_or(false) ? 1 : 0);
  for (const std::string& path : paths) {
    if (auto ok = CheckSave(path, k, oracle.ambient_dimension()); !ok)
      return tl::unexpected(ok.error());
  }
  return Repeat<SavedMesh>(oracle, options, client::Run::Watching::kProgress,
                           [&paths](client::Run& run, Mesh&&) { return run.SaveTo(paths); });
}

Expected<ServerHealth> CheckHealth(const Connection& connection, Seconds timeout) {
  Expected<Monitor> monitor = Monitor::Connect(connection);
  if (!monitor) return tl::unexpected(monitor.error());
  return monitor->Health(timeout);
}

}  // namespace stellate
