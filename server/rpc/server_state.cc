#include "server/rpc/server_state.h"

namespace stellate::server {

void ApplyServerPolicy(ServerState& state, SessionOptions* options) {
  const Config& config = state.config;
  options->policy.dispatch.chunk_bytes = ChunkBytes(config);
  options->policy.dispatch.max_in_flight = config.max_in_flight;
  options->policy.dispatch.check_share = config.check_share;
  options->policy.max_workers = config.max_workers;
  options->policy.max_watchers = config.max_watchers;
  options->ports.observer = state.metrics.observer();
  options->ports.memory = MemoryBudget::Open(state.memory, options->request.owner);
}

}  // namespace stellate::server
