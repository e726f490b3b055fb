#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "core/batch.h"
#include "server/oracle_pool.h"

namespace stellate::server {

enum class SessionState;
struct SessionOptions;

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

// What a journal knows of a mesh that an earlier server left.
struct SessionRecord {
  std::chrono::system_clock::time_point create_time;
  std::uint64_t rounds = 0;       // 1 to `rounds` can be replayed
  std::optional<SessionEnd> end;  // none: it is to go on
};

// One mesh's place in a journal: what it was asked to be, and the answers of each round, which
// together determine it bit for bit. Writes return once the data is on the disk, so they block and
// come from the session's own thread alone; a failure says why nothing was written.
class SessionJournal {
 public:
  virtual ~SessionJournal() = default;

  // Once, before anything is asked.
  virtual std::optional<MeshFailure> WriteStart(
      const SessionOptions& options, std::chrono::system_clock::time_point create_time) = 0;
  // Before anyone may see what the answers lead to.
  virtual std::optional<MeshFailure> WriteRound(const core::QueryBatch& batch,
                                                const core::Answers& answers) = 0;
  virtual std::optional<MeshFailure> WriteEnd(const SessionEnd& end) = 0;

  struct Replay {
    std::optional<core::Answers> answers;
    std::optional<MeshFailure> failure;  // the record is of other questions, or cannot be read
  };
  // The recorded answers to this batch; neither member set: it was never answered.
  virtual Replay ReadRound(const core::QueryBatch& batch) = 0;

  // The mesh was deleted: removes its record, soon. Any thread; does not block.
  virtual void Forget() = 0;
};

}  // namespace stellate::server
