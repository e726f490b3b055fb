#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>

#include "core/mesher.h"
#include "core/report.h"
#include "server/base/occasion.h"
#include "server/memory/memory_budget.h"
#include "server/oracles/oracle_pool.h"
#include "server/session/session_journal.h"
#include "server/spans/span.h"
#include "server/turns/turns.h"

namespace stellate::server {

// Receives the rounds and the end of a session, for the metrics. On the session's thread; must not
// block.
class SessionObserver : public PoolObserver {
 public:
  virtual void OnRound(std::size_t queries) = 0;  // answered
  virtual void OnPoints(std::size_t points) = 0;  // of a reconstruction, recorded
  virtual void OnEnd(SessionState state, const core::Report& report) = 0;
};

// Makes what a session runs.
using MesherFactory = std::function<core::Expected<std::unique_ptr<core::Mesher>>(
    core::Specification, core::Execution)>;

// What the server decides about a mesh, for every owner.
struct MeshPolicy {
  DispatchPolicy dispatch;
  core::Execution execution;
  std::size_t max_workers = 64;
  std::size_t max_watchers = 64;
};

// What a session works with.
struct SessionPorts {
  std::shared_ptr<SessionObserver> observer;      // may be null
  std::shared_ptr<SessionJournal> journal;        // may be null: the mesh lives in memory alone
  std::shared_ptr<MemoryBudget::Account> memory;  // may be null: its memory is not counted
  std::shared_ptr<Turns> turns;                   // may be null: it computes whenever it has work
  std::shared_ptr<SpanSink> spans;                // may be null: none are sent
  // Called when the replay is over, and again before Run is; may be empty.
  std::function<void()> on_replayed;
  // Happens once the journal has the mesh, or will never have it: clients may hear of it then.
  std::shared_ptr<Occasion> recorded = std::make_shared<Occasion>();
};

// What a session is made of, fixed for its life.
struct SessionOptions {
  MeshRequest request;
  MeshPolicy policy;
  SessionPorts ports;
  std::optional<SessionRecord> record;  // set: the journal has it from an earlier server
  MesherFactory examiner;               // set: it examines an oracle, and no journal has it
};

}  // namespace stellate::server
