#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/batch.h"
#include "core/report.h"
#include "server/base/clock.h"
#include "server/base/failure.h"
#include "server/oracles/pool_follower.h"
#include "server/session/mesh_request.h"
#include "server/spans/span.h"

namespace stellate::server {

// Makes the spans of one mesh: of the mesh, its rounds, what each round did and what its workers
// were asked, and of the workers. docs/running/traces.md says what a reader finds in them.
//
//   spans.BeginRound(batch, before_it_was_planned);      // "plan" has ended
//   spans.Step("ask"); ... spans.Step("absorb");         // each from the end of the one before
//   spans.EndRound();
//   spans.End({...});                                    // the mesh, once
//
// Chunks of a round, and workers, are bounded in number, and so are short rounds; those that are
// left out are counted. Where no spans are sent it does nothing. The session's thread calls it, and
// its pool, from any thread.
class MeshSpans final : public PoolFollower {
 public:
  // Of each round: those that no answer came to, then those that took longest.
  static constexpr std::size_t kMostChunks = 8;
  // Later rounds have spans where they take `kLongRound`.
  static constexpr std::uint64_t kMostRounds = 1000;
  static constexpr std::chrono::seconds kLongRound{1};
  static constexpr std::size_t kMostWorkers = 100;  // of a mesh, that have a span

  // `sink` null, or the client's trace not sampled: there are none. `kind`: the name of the mesh's
  // span. `is_resumed`: an earlier server began the mesh.
  MeshSpans(std::shared_ptr<SpanSink> sink, const MeshRequest& request, const char* kind,
            bool is_resumed);

  bool IsActive() const { return sink_ != nullptr; }

  // The answers of `rounds` rounds were read back, since the server took the mesh up.
  void Replayed(std::uint64_t rounds);

  // `planned`: when its planning began.
  void BeginRound(const core::QueryBatch& batch, TimePoint planned);
  void Step(const char* name);
  // Why the round fails, or what comes after it.
  void Fail(const std::string& why);
  void EndRound();

  struct Ending {
    const char* state;
    const MeshFailure& failure;
    const core::Report& report;
    const core::Progress& progress;
  };
  void End(const Ending& ending);

  void OnJoined(WorkerId worker, const std::string& name, const TraceHeaders& trace) override;
  void OnLeft(WorkerId worker) override;
  void OnAsked(const Lease& lease) override;
  void OnAnswered(LeaseId lease, Dispatch::AcceptResult result) override;

 private:
  struct Chunk {
    WorkerId worker = 0;
    std::int64_t queries = 0;
    bool is_check = false, is_hedge = false;
    TimePoint asked, done;
    const char* outcome = nullptr;  // null: no answer yet

    bool is_lost() const;
    bool MattersMoreThan(const Chunk& other) const;
  };
  struct Worker {
    std::string name;
    TraceHeaders trace;
    TimePoint joined;
    std::int64_t chunks = 0, queries = 0;  // answered
  };
  struct Round {
    Round();

    Span span;
    std::vector<Span> steps;
    TimePoint begun, step_begun;
    std::optional<double> waited;             // seconds until the first chunk was handed out
    std::size_t asked = 0;                    // chunks
    std::unordered_map<LeaseId, Chunk> open;  // not answered yet
    std::vector<Chunk> kept;                  // that matter most, so far
    SpanId ask_id = NewSpanId();              // of the step that chunks are a part of
  };

  std::chrono::system_clock::time_point WallTime(TimePoint time) const;
  Span Begun(const char* name, const TraceContext& above, TimePoint start, TimePoint end) const;
  void Keep(const Chunk& chunk);                // (locked)
  std::vector<Span> ChunkSpans(TimePoint now);  // (locked)
  void EndRoundLocked();

  std::shared_ptr<SpanSink> sink_;  // null: none are sent
  const std::string name_;          // of the mesh
  const TimePoint begun_;
  const std::chrono::system_clock::time_point wall_begun_;
  std::mutex mutex_;
  Span mesh_;
  std::optional<Round> round_;
  std::uint64_t rounds_ = 0, rounds_left_out_ = 0;
  std::string failure_;
  std::unordered_map<WorkerId, Worker> workers_;  // joined
  std::size_t workers_joined_ = 0;
};

// A round, from here to the end of the scope.
class RoundSpan {
 public:
  RoundSpan(MeshSpans* spans, const core::QueryBatch& batch, TimePoint planned) : spans_(spans) {
    spans_->BeginRound(batch, planned);
  }
  ~RoundSpan() { spans_->EndRound(); }
  RoundSpan(const RoundSpan&) = delete;
  RoundSpan& operator=(const RoundSpan&) = delete;

 private:
  MeshSpans* const spans_;
};

}  // namespace stellate::server
