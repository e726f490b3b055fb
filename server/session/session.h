#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "core/base/interruption.h"
#include "core/mesher.h"
#include "server/base/log.h"
#include "server/oracles/oracle_pool.h"
#include "server/points/point_intake.h"
#include "server/session/history_shelf.h"
#include "server/session/mesh_spans.h"
#include "server/session/session_life.h"
#include "server/session/session_options.h"

namespace stellate::server {

// A session at one moment.
struct SessionView {
  SessionState state = SessionState::kWaiting;
  std::chrono::system_clock::time_point create_time;
  std::optional<std::chrono::system_clock::time_point> end_time;
  std::uint64_t revision = 0;
  core::Progress progress;
  double elapsed_seconds = 0;
  double remaining_seconds = 0;           // 0: unknown
  std::optional<core::Report> report;     // once it is over
  MeshFailure failure;                    // when it failed
  std::size_t workers = 0, watchers = 0;  // an upload of points is a worker
  std::size_t waiting_queries = 0;        // of this round, unanswered; points that have not come
  std::uint64_t bytes = 0;                // estimated; 0 where memory is not counted
};

// Runs one mesh: passes a core::Mesher's queries to the pool, publishes each round to the history,
// and records everything in the journal. A reconstruction's rounds are its points, and come from
// the intake instead. session_life.h has its states and transitions. Does not use the network.
//
//   auto session = std::make_shared<Session>(options);
//   std::thread thread([session] { session->Run(); });
//   session->pool().Join(worker, 0);                // workers' streams, on any thread
//   session->history().AddWatcher(watcher);         // watchers' streams, on any thread
class Session {
 public:
  using MesherFactory = server::MesherFactory;

  explicit Session(SessionOptions options, const MesherFactory& factory = core::Mesher::Create);

  // Meshes to the end, on the calling thread. Call it once, and not if Over() is true already: a
  // finished mesh whose journal is complete.
  void Run();
  // Whether Run only has to return: the mesher's memory has been released. That follows HasEnded
  // immediately, or a tenth of a second later after millions of vertices.
  bool Over() const;

  // Ends the mesh; any thread. Takes effect immediately where Run waits, else after the round being
  // computed, or after the replay. A mesh that had ended before its replay stays as it was.
  void Cancel();

  // Ends Run as soon as possible: the mesh was deleted.
  void Abandon();
  // The same for a mesh that was never run and will not be.
  void AbandonUnrun();
  // As Abandon, because the server stops: with a journal, the next server goes on.
  void Suspend();

  bool IsReplaying() const;
  // Memory that the mesh will occupy when its replay is over, in bytes.
  std::uint64_t ReplayBytes() const;

  SessionView View() const;
  bool HasVertices() const;
  bool HasEnded() const;           // state, report and history are final
  LogContext log_context() const;  // in the round that was last shown
  const MeshRequest& request() const { return options_.request; }
  const MeshPolicy& policy() const { return options_.policy; }
  const SessionPorts& ports() const { return options_.ports; }
  OraclePool& pool() { return pool_; }
  PointIntake* intake() { return intake_.get(); }  // of a reconstruction alone; else null
  HistoryShelf& history() { return history_; }
  const HistoryShelf& history() const { return history_; }

 private:
  // How Run ends the mesh.
  struct Ending {
    SessionEnd end;
    core::Report report;
    bool server_stops = false;
    bool is_elsewhere = false;  // another server has the mesh
    bool is_suspended = false;  // the next server goes on with the mesh: nothing is recorded
    bool is_whole = false;      // the mesh is what led to this end, on this server or before
  };

  Life life() const;
  void Step(LifeEvent event);
  void SetInterruptible(core::Mesher* mesher);
  void RunRounds(core::Mesher* mesher);
  void ReplayRound(core::Mesher* mesher, const core::QueryBatch& batch);
  void EndReplay(core::Mesher* mesher, std::uint64_t next_round);
  void RepeatEnd(core::Mesher* mesher);
  void RunRound(core::Mesher* mesher, const std::shared_ptr<const core::QueryBatch>& batch,
                TimePoint planned);
  OraclePool::Outcome Ask(core::Mesher* mesher,
                          const std::shared_ptr<const core::QueryBatch>& batch,
                          SessionJournal::Known known);
  bool FitsMemory(core::Mesher* mesher, std::uint64_t queries);
  bool Absorb(core::Mesher* mesher, const core::Answers& answers);
  std::optional<MeshFailure> PublishRound(core::Mesher* mesher);
  void Orient();
  void FailBlameless(core::Mesher* mesher, MeshFailure failure);
  void Fail(core::Mesher* mesher, MeshFailure failure, core::Status status);
  SessionState FinalState(const core::Report* report) const;
  Ending ChooseEnd(const core::Report* report);
  bool RecordEnd(const Ending& ending);
  void ShowEnd(const Ending& ending);
  void RecordResult();

  const SessionOptions options_;
  const MesherFactory factory_;
  MeshSpans spans_;  // outlives the pool
  OraclePool pool_;
  const std::unique_ptr<PointIntake> intake_;  // of a reconstruction alone
  HistoryShelf history_;
  const std::chrono::system_clock::time_point create_time_;
  const TimePoint created_;  // as if no time had passed without a server

  // For Run's thread alone:
  MeshFailure failure_;
  core::Status blame_;                     // what all workers receive at the end
  std::optional<core::MeshDelta> unseen_;  // absorbed, not published yet

  core::Interruption orienting_;

  mutable std::mutex mutex_;
  SessionLife life_;
  core::Mesher* computing_ = nullptr;  // while it lives
  core::Progress progress_;
  std::optional<SessionEnd> end_;  // once clients can see it, as the report
  std::optional<core::Report> report_;
};

// Another server goes on with the mesh: clients are to be led there, and see nothing of it here.
bool IsElsewhere(const Session& session);
// It has failed as its owner has as many meshes as the servers allow together.
bool IsBeyondLimit(const Session& session);

}  // namespace stellate::server
