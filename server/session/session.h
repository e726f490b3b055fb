#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/mesher.h"
#include "server/base/log.h"
#include "server/history/watch_log.h"
#include "server/memory/memory_budget.h"
#include "server/oracles/oracle_pool.h"
#include "server/session/session_journal.h"

namespace stellate::server {

// Told what becomes of a session, for the metrics. From the session's thread; must not block.
class SessionObserver : public PoolObserver {
 public:
  virtual void OnRound(std::size_t queries) = 0;  // answered
  virtual void OnEnd(SessionState state, const core::Report& report) = 0;
};

// What the server decides about a mesh, whoever asked for it.
struct MeshPolicy {
  DispatchPolicy dispatch;
  std::size_t max_workers = 64;
  std::size_t max_watchers = 64;
};

// What a session works with.
struct SessionPorts {
  std::shared_ptr<SessionObserver> observer;      // may be null
  std::shared_ptr<SessionJournal> journal;        // may be null: the mesh lives in memory alone
  std::shared_ptr<MemoryBudget::Account> memory;  // may be null: nobody counts
  std::function<void()> on_replayed;  // after the replay, or when Run is over; may be empty
};

// What a session is made of, fixed for its life.
struct SessionOptions {
  MeshRequest request;
  MeshPolicy policy;
  SessionPorts ports;
  std::optional<SessionRecord> record;  // set: the journal has it from an earlier server
};

// A session at one moment.
struct SessionView {
  SessionState state = SessionState::kWaiting;
  std::chrono::system_clock::time_point create_time;
  std::optional<std::chrono::system_clock::time_point> end_time;
  std::uint64_t revision = 0;
  core::Progress progress;
  double elapsed_seconds = 0;
  double remaining_seconds = 0;        // 0: unknown
  std::optional<core::Report> report;  // once it is over
  MeshFailure failure;                 // when it failed
  std::size_t workers = 0, watchers = 0;
  std::size_t waiting_queries = 0;  // of this round, unanswered
  std::uint64_t bytes = 0;          // estimated; 0 where nobody counts
};

// Told when a session has something new. Wake comes from any thread and must not block.
class SessionWatcher {
 public:
  virtual ~SessionWatcher() = default;
  virtual void Wake() = 0;
};

// One mesh: drives a core::Mesher on a thread of its own, asks the pool, keeps the history, in
// memory or, once it is over, in its journal. Knows nothing of the network.
class Session {
 public:
  using MesherFactory =
      std::function<core::Expected<std::unique_ptr<core::Mesher>>(core::Specification)>;

  explicit Session(SessionOptions options, MesherFactory factory = core::Mesher::Create);

  // Meshes to the end, on the calling thread. Once only, and not at all when it is Over before: a
  // finished mesh that its journal has whole.
  void Run();
  // Run has nothing left to do but return, and the memory of the mesher is given back. It follows
  // HasEnded at once, or a tenth of a second later after millions of vertices.
  bool Over() const { return over_; }

  // Ends the mesh; any thread, at once where Run waits, else after the round being computed, or
  // after the replay. One that had ended before its replay stays as it was.
  void Cancel();

  // Ends Run as soon as can be: nobody wants the mesh any more.
  void Abandon();
  // The same for one that was never run and will not be.
  void AbandonUnrun();
  // As Abandon, because the server stops: with a journal, the next server goes on.
  void Suspend();

  bool IsReplaying() const { return replaying_; }
  bool IsCancelled() const { return cancelled_; }
  // What the mesh will hold when its replay is over, in bytes.
  std::uint64_t ReplayBytes() const;

  // False when there are too many.
  bool AddWatcher(std::weak_ptr<SessionWatcher> watcher);

  SessionView View() const;
  std::uint64_t revision() const;  // the newest that can be read
  // The newest revision that anyone may have seen: while a recorded mesh is replayed, the one at
  // which the replay will end.
  std::uint64_t PublishedRevision() const;
  // How it stood at revisions after this one.
  std::vector<PastProgress> PastAfter(std::uint64_t revision) const;
  bool HasVertices() const;
  bool HasEnded() const;           // state, report and history are final
  LogContext log_context() const;  // in the round that was last shown
  const MeshRequest& request() const { return options_.request; }
  const MeshPolicy& policy() const { return options_.policy; }
  const SessionPorts& ports() const { return options_.ports; }
  OraclePool& pool() { return pool_; }

  // Null: the journal has it, and it is not in memory. Whoever holds it keeps it there.
  std::shared_ptr<const WatchLog> history() const;
  // Reads it back, if the memory budget allows, and wakes the watchers. May take a while.
  enum class Loading { kDone, kNoMemory, kFailed };
  Loading LoadHistory();
  // kFailed came of it.
  bool HistoryIsLost() const;
  // Takes it from memory, if the journal has it and nobody has held it for `unused`.
  bool PutAwayHistory(Clock::duration unused);

 private:
  void SetInterruptible(core::Mesher* mesher);
  void RunRounds(core::Mesher* mesher);
  void ReplayRound(core::Mesher* mesher, const core::QueryBatch& batch);
  void EndReplay();
  void RepeatEnd(core::Mesher* mesher);
  void RunRound(core::Mesher* mesher, const std::shared_ptr<const core::QueryBatch>& batch);
  bool Absorb(core::Mesher* mesher, const core::Answers& answers);
  std::optional<MeshFailure> PublishRound(core::Mesher* mesher);
  bool FitsMemory(core::Mesher* mesher, std::uint64_t queries);
  void FailBlameless(core::Mesher* mesher, MeshFailure failure);
  void Fail(core::Mesher* mesher, MeshFailure failure, core::Status status);
  void Finish(const core::Report* report);
  void RecordResult();
  void CountHistory();
  void Interrupt();
  SessionState FinalState(const core::Report* report) const;
  void WakeWatchers();

  const SessionOptions options_;
  const MesherFactory factory_;
  OraclePool pool_;
  const std::chrono::system_clock::time_point create_time_;
  const TimePoint created_;  // as if no time had passed without a server
  std::atomic<bool> cancelled_{false};
  std::atomic<bool> abandoned_{false};
  std::atomic<bool> stopping_{false};  // the server does
  std::atomic<bool> over_{false};
  std::atomic<bool> replaying_;            // the journal has the next answers
  bool end_is_recorded_ = false;           // Run's thread only
  core::Status blame_;                     // Run's thread only: told to all workers at the end
  std::optional<core::MeshDelta> unseen_;  // Run's thread only: absorbed, not in the history yet

  mutable std::mutex mutex_;
  std::shared_ptr<WatchLog> history_;  // null: only in the journal
  std::uint64_t revision_ = 0;         // the last, where the journal has it
  std::uint64_t history_bytes_ = 0;    // in memory, about; where the journal has it
  bool result_is_recorded_ = false;
  bool history_is_lost_ = false;
  mutable TimePoint history_used_;
  core::Mesher* computing_ = nullptr;  // while it lives
  bool ending_ = false;                // the final state is chosen, and being recorded
  bool suspended_ = false;             // the server stopped it, not its owner
  std::optional<SessionState> final_state_;
  std::optional<std::chrono::system_clock::time_point> end_time_;
  double final_seconds_ = 0;
  core::Progress progress_;
  ProgressHistory past_;
  std::optional<core::Report> report_;
  MeshFailure failure_;
  std::vector<std::weak_ptr<SessionWatcher>> watchers_;
};

}  // namespace stellate::server
