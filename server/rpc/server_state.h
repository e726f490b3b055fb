#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "server/auth/auth.h"
#include "server/config/config.h"
#include "server/journal/journal.h"
#include "server/memory/memory_budget.h"
#include "server/metrics/metrics.h"
#include "server/rpc/router.h"
#include "server/rpc/streams.h"
#include "server/session/session_store.h"
#include "server/spans/span.h"

namespace stellate::server {

// The settings in force, which may change while calls read them. Any thread.
class SettingsInForce {
 public:
  explicit SettingsInForce(Config config) { Set(std::move(config)); }

  // As they are now: they stay for who holds them.
  std::shared_ptr<const Config> Get() const {
    const std::lock_guard lock(mutex_);
    return config_;
  }
  void Set(Config config) {
    auto next = std::make_shared<const Config>(std::move(config));
    const std::lock_guard lock(mutex_);
    config_ = std::move(next);
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Config> config_;
};

// The state that all calls of a server share.
struct ServerState {
  ServerState(const Config& config, Session::MesherFactory factory);

  std::shared_ptr<const Config> config() const { return settings.Get(); }
  // From now on; what was admitted by other limits stays. REQUIRES: `config` differs only in
  // settings that may change while a server runs, and has no zeros that stand for something.
  void Adopt(const Config& config);
  // Why no client can begin a mesh; empty: they can.
  std::string WhyNoNewMeshes() const;

  SettingsInForce settings;
  const std::shared_ptr<MemoryBudget> memory, stream_memory;
  const std::shared_ptr<Turns> turns;
  StreamRegistry streams;
  std::unique_ptr<Journal> journal;  // null: meshes live in memory alone
  SessionStore store;
  std::shared_ptr<Authenticator> authenticator;  // set before the first call
  Metrics metrics;
  std::shared_ptr<SpanSink> spans;    // null: none are sent; set before the first mesh
  std::atomic<bool> draining{false};  // no new meshes
  Router router{this};
};

// Writes the server's policy for a mesh, whatever its owner, into `options`. REQUIRES: its owner is
// set.
void ApplyServerPolicy(ServerState& state, SessionOptions* options);

}  // namespace stellate::server
