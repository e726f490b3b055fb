#include "server/rpc/server_state.h"

#include <chrono>
#include <utility>

namespace stellate::server {
namespace {

StoreLimits ToStoreLimits(const Config& config) {
  return {config.max_meshes, config.keep_finished_meshes,
          std::chrono::duration_cast<Clock::duration>(
              std::chrono::duration<double>(config.keep_finished_seconds)),
          config.owner_meshes};
}

MemoryBudget::Limits ToMemoryLimits(const Config& config) {
  return {config.max_memory_bytes, config.owner_memory_bytes};
}

}  // namespace

ServerState::ServerState(const Config& config, Session::MesherFactory factory)
    : settings(config),
      memory(std::make_shared<MemoryBudget>(ToMemoryLimits(config))),
      stream_memory(
          std::make_shared<MemoryBudget>(ToMemoryLimits(config), MemoryBudget::Of::kStreams)),
      turns(std::make_shared<Turns>(config.max_processors)),
      store(ToStoreLimits(config), std::move(factory)) {
  memory->MakeRoomBy([this] { return store.UnloadHistories(); });
}

void ServerState::Adopt(const Config& config) {
  settings.Set(config);
  for (const auto& budget : {memory, stream_memory}) budget->SetLimits(ToMemoryLimits(config));
  store.SetLimits(ToStoreLimits(config));
}

std::string ServerState::WhyNoNewMeshes() const {
  if (draining) return "draining";
  return journal == nullptr ? "" : journal->WhyNoNewMeshes();
}

void ApplyServerPolicy(ServerState& state, SessionOptions* options) {
  const std::shared_ptr<const Config> in_force = state.config();
  const Config& config = *in_force;
  options->policy.dispatch.chunk_bytes = ChunkBytes(config);
  options->policy.dispatch.max_in_flight = config.max_in_flight;
  options->policy.dispatch.check_share = config.check_share;
  options->policy.execution.threads = static_cast<int>(config.max_processors);
  options->policy.max_workers = config.max_workers;
  options->policy.max_watchers = config.max_watchers;
  options->ports.observer = state.metrics.observer();
  options->ports.turns = state.turns;
  options->ports.spans = state.spans;
  options->ports.memory = MemoryBudget::Open(state.memory, options->request.owner);
}

}  // namespace stellate::server
