#pragma once

#include <atomic>
#include <memory>

#include "server/auth/auth.h"
#include "server/config/config.h"
#include "server/journal/journal.h"
#include "server/memory/memory_budget.h"
#include "server/metrics/metrics.h"
#include "server/rpc/streams.h"
#include "server/session/session_store.h"

namespace stellate::server {

// The state that all calls of a server share.
struct ServerState {
  ServerState(const Config& config_in, StoreLimits limits, Session::MesherFactory factory)
      : config(config_in),
        memory(std::make_shared<MemoryBudget>(
            MemoryBudget::Limits{config.max_memory_bytes, config.owner_memory_bytes})),
        stream_memory(std::make_shared<MemoryBudget>(
            MemoryBudget::Limits{config.max_memory_bytes, config.owner_memory_bytes},
            MemoryBudget::Of::kStreams)),
        store(limits, std::move(factory)) {
    memory->MakeRoomBy([this] { return store.UnloadHistories(); });
  }

  const Config config;
  const std::shared_ptr<MemoryBudget> memory, stream_memory;
  StreamRegistry streams;
  std::unique_ptr<Journal> journal;  // null: meshes live in memory alone
  SessionStore store;
  std::shared_ptr<Authenticator> authenticator;  // set before the first call
  Metrics metrics;
  std::atomic<bool> draining{false};  // no new meshes
};

// Writes the server's policy for a mesh, whatever its owner, into `options`. REQUIRES: its owner is
// set.
void ApplyServerPolicy(ServerState& state, SessionOptions* options);

}  // namespace stellate::server
