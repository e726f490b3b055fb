#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/batch.h"
#include "core/report.h"
#include "server/history/watch_log.h"
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
  std::uint64_t rounds = 0;  // that led to it; what a later one would have led to nobody has seen
};

// How long ago that was; zero if the clock was set back to before it.
Clock::duration AgeOf(std::chrono::system_clock::time_point time);

// What became of a mesh that has ended, without its history.
struct SessionResult {
  core::Progress progress;
  core::Report report;
  std::uint64_t revision = 0;
  std::uint64_t history_bytes = 0;  // in memory, about
  ProgressHistory past;             // empty in records of earlier servers
};

// How a mesh stood when a round of it was answered.
struct Standing {
  std::uint64_t vertices = 0;  // that it had when it asked
  // That servers have had it for. The clock on the wall may be set while none has, so that no
  // difference of its times says this.
  double elapsed_seconds = 0;
};

// What a journal knows of a mesh that an earlier server left.
struct SessionRecord {
  std::chrono::system_clock::time_point create_time;
  std::uint64_t rounds = 0;             // 1 to `rounds` can be replayed
  Standing last;                        // in the last of them
  std::optional<SessionEnd> end;        // none: it is to go on
  std::optional<SessionResult> result;  // set: it needs no replay
};

// One mesh's place in a journal: what it was asked to be, and the answers of each round, which
// together determine it bit for bit; once it has ended, the mesh itself in their place. Unless it
// says otherwise, a call may wait for the disk, and comes from the session's own thread alone.
// Writes return once the data is on the disk; a failure says why nothing was written.
class SessionJournal {
 public:
  virtual ~SessionJournal() = default;

  // Once, before anything is asked.
  virtual std::optional<MeshFailure> WriteStart(
      const MeshRequest& request, std::chrono::system_clock::time_point create_time) = 0;

  struct Known {
    std::optional<core::Answers> answers;  // to the whole batch
    std::vector<PartOfRound> parts;        // else: to some of it, in the order that Ask wants
    std::optional<MeshFailure> failure;    // the record is of other questions, or cannot be read
  };
  // What is recorded of the answers to this batch.
  virtual Known BeginRound(const core::QueryBatch& batch) = 0;
  // Answers of the round that came, as OraclePool::OnAnswered tells of them: they are written soon,
  // so that a server that is killed does not ask for them again. Any thread; does not block.
  virtual void TakeAnswers(const std::shared_ptr<const Round>& round, std::size_t block,
                           Eigen::Index first, Eigen::Index count) = 0;
  // Before anyone may see what the answers lead to.
  virtual std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch,
                                                const core::Answers& answers,
                                                const Standing& standing) = 0;
  virtual std::optional<MeshFailure> WriteEnd(const SessionEnd& end) = 0;

  // After WriteEnd: from now on the mesh needs no replay, and its answers are removed.
  virtual std::optional<MeshFailure> WriteResult(const SessionResult& result,
                                                 const WatchLog& history) = 0;
  // As WriteResult wrote it. Any thread.
  virtual core::Expected<std::unique_ptr<WatchLog>> ReadHistory() = 0;

  // The mesh was deleted: removes its record, soon. Any thread; does not block.
  virtual void Forget() = 0;
};

}  // namespace stellate::server
