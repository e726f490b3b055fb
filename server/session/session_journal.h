#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/batch.h"
#include "core/report.h"
#include "server/history/mesh_history.h"
#include "server/oracles/oracle_pool.h"
#include "server/session/mesh_request.h"
#include "server/session/progress_history.h"
#include "server/session/session_state.h"

namespace stellate::server {

// How a mesh ended.
struct SessionEnd {
  SessionState state{};
  std::chrono::system_clock::time_point time;
  double elapsed_seconds = 0;
  MeshFailure failure;       // when it failed
  std::uint64_t rounds = 0;  // that led to it; no client has seen what later ones led to
};

// How long ago that was; zero if the clock was set back to before it.
Clock::duration AgeOf(std::chrono::system_clock::time_point time);

// The result of a mesh that has ended, without its history.
struct SessionResult {
  core::Progress progress;
  core::Report report;
  std::uint64_t revision = 0;
  std::uint64_t history_bytes = 0;  // in memory, about
  ProgressHistory past;             // empty in records of earlier servers
};

// The state of a mesh when a round of it was answered.
struct Standing {
  std::uint64_t vertices = 0;  // when the round began
  // For how long servers have run the mesh. Not a difference of wall-clock times: the clock may be
  // set while no server runs.
  double elapsed_seconds = 0;
};

// What a journal has of a mesh from an earlier server.
struct SessionRecord {
  std::chrono::system_clock::time_point create_time;
  std::uint64_t rounds = 0;             // 1 to `rounds` can be replayed
  Standing last;                        // in the last of them
  std::optional<SessionEnd> end;        // none: the mesh goes on
  std::optional<SessionResult> result;  // set: it needs no replay
};

// The record of one mesh in a journal: its request and the answers of each round, which together
// determine it bit for bit; once it has ended, the mesh itself replaces the answers. Unless stated
// otherwise, calls come from the session's thread alone and may wait for the disk. A write returns
// once the data is on the disk; a failure says why nothing was written.
//
//   WriteStart; for each round: BeginRound, TakeAnswers as they come, WriteRound; WriteEnd,
//   WriteResult
class SessionJournal {
 public:
  virtual ~SessionJournal() = default;

  // Once, before the first round.
  virtual std::optional<MeshFailure> WriteStart(
      const MeshRequest& request, std::chrono::system_clock::time_point create_time) = 0;

  struct Known {
    std::optional<core::Answers> answers;  // to the whole batch
    std::vector<PartOfRound> parts;        // else: to some of it, in the order of OraclePool::Ask
    std::optional<MeshFailure> failure;    // the record has other queries, or cannot be read
  };
  // Returns the recorded answers to this batch.
  virtual Known BeginRound(const core::QueryBatch& batch) = 0;
  // Takes answers of the round as an OraclePool::OnAnswered. They are written soon, so that a
  // server that is killed does not ask for them again. Any thread; does not block.
  virtual void TakeAnswers(const std::shared_ptr<const Round>& round, std::size_t block,
                           Eigen::Index first, Eigen::Index count) = 0;
  // Before a client can see what the answers lead to.
  virtual std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch,
                                                const core::Answers& answers,
                                                const Standing& standing) = 0;
  virtual std::optional<MeshFailure> WriteEnd(const SessionEnd& end) = 0;

  // After WriteEnd. From now on the mesh needs no replay, and its answers are removed.
  virtual std::optional<MeshFailure> WriteResult(const SessionResult& result,
                                                 const MeshHistory& history) = 0;
  // Reads back what WriteResult wrote. Any thread.
  virtual core::Expected<std::unique_ptr<MeshHistory>> ReadHistory() = 0;

  // The mesh was deleted: removes its record, soon. Any thread; does not block.
  virtual void Forget() = 0;

  // Another server goes on with the mesh: nothing of it is written here any more, and no client may
  // hear of it what is not recorded. Any thread.
  virtual bool IsElsewhere() const { return false; }
  // WriteStart failed as its owner has as many meshes as the servers allow together. Any thread.
  virtual bool IsBeyondLimit() const { return false; }
};

}  // namespace stellate::server
