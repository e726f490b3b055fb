#include "server/session/mesh_spans.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace stellate::server {
namespace {

constexpr std::size_t kMostWords = 1024;  // bytes of a failure
constexpr std::size_t kMostOpen = 4096;   // chunks that are followed at a time

double SecondsBetween(TimePoint from, TimePoint to) {
  return std::chrono::duration<double>(to - from).count();
}

std::string Shortened(const std::string& words) {
  return words.size() <= kMostWords ? words : words.substr(0, kMostWords) + "...";
}

// Where a mesh's span belongs. Of a trace that is not sampled there are no spans.
TraceContext PlaceOf(const MeshRequest& request) {
  if (auto context = ReadTraceContext(request.trace)) return std::move(*context);
  return {TraceOfMesh(request.name), {}, true, ""};
}

const char* OutcomeOf(Dispatch::AcceptResult result) {
  switch (result) {
    case Dispatch::AcceptResult::kCounts:
      return "answered";
    case Dispatch::AcceptResult::kForComparison:
      return "compared";
    case Dispatch::AcceptResult::kLate:
      return "late";
    case Dispatch::AcceptResult::kUnknown:
      break;
  }
  return nullptr;
}

}  // namespace

bool MeshSpans::Chunk::is_lost() const {
  return outcome == nullptr || std::strcmp(outcome, "worker left") == 0;
}

bool MeshSpans::Chunk::MattersMoreThan(const Chunk& other) const {
  if (is_lost() != other.is_lost()) return is_lost();
  return done - asked > other.done - other.asked;
}

MeshSpans::Round::Round() = default;

MeshSpans::MeshSpans(std::shared_ptr<SpanSink> sink, const MeshRequest& request, const char* kind,
                     bool is_resumed)
    : sink_(std::move(sink)),
      name_(request.name),
      begun_(Clock::now()),
      wall_begun_(std::chrono::system_clock::now()) {
  if (sink_ == nullptr) return;
  mesh_.above = PlaceOf(request);
  if (!mesh_.above.sampled) {
    sink_.reset();
    return;
  }
  mesh_.name = kind;
  mesh_.is_remote = true;
  mesh_.start = wall_begun_;
  mesh_.Add("stellate.mesh", name_);
  if (!request.owner.empty()) mesh_.Add("stellate.owner", request.owner);
  if (!request.label.empty()) mesh_.Add("stellate.label", request.label);
  mesh_.Add("stellate.dimension", request.spec.dimension);
  mesh_.Add("stellate.ambient_dimension", request.spec.ambient_dimension);
  if (request.points) {
    mesh_.Add("stellate.points", request.points->points);
  } else {
    mesh_.Add("stellate.epsilon", request.spec.epsilon);
  }
  mesh_.Add("stellate.resumed", is_resumed);
}

// One look at the wall clock: it may be set while the mesh runs, and spans must not change places.
std::chrono::system_clock::time_point MeshSpans::WallTime(TimePoint time) const {
  return wall_begun_ +
         std::chrono::duration_cast<std::chrono::system_clock::duration>(time - begun_);
}

Span MeshSpans::Begun(const char* name, const TraceContext& above, TimePoint start,
                      TimePoint end) const {
  Span span;
  span.above = above;
  span.name = name;
  span.start = WallTime(start);
  span.end = WallTime(end);
  return span;
}

void MeshSpans::Replayed(std::uint64_t rounds) {
  if (!IsActive()) return;
  Span span = Begun("replay", mesh_.Within(), begun_, Clock::now());
  span.Add("stellate.rounds", rounds);
  sink_->Take({std::move(span)});
}

void MeshSpans::BeginRound(const core::QueryBatch& batch, TimePoint planned) {
  if (!IsActive()) return;
  {
    const std::lock_guard lock(mutex_);
    Round& round = round_.emplace();
    round.begun = round.step_begun = planned;
    round.span = Begun("round", mesh_.Within(), planned, planned);
    round.span.Add("stellate.round", batch.round);
    round.span.Add("stellate.queries", batch.size());
  }
  Step("plan");
}

void MeshSpans::Step(const char* name) {
  if (!IsActive()) return;
  const TimePoint now = Clock::now();
  const std::lock_guard lock(mutex_);
  if (!round_) return;
  Span& step =
      round_->steps.emplace_back(Begun(name, round_->span.Within(), round_->step_begun, now));
  if (std::strcmp(name, "ask") == 0) step.id = round_->ask_id;
  round_->step_begun = now;
}

void MeshSpans::Fail(const std::string& why) {
  if (!IsActive()) return;
  const std::lock_guard lock(mutex_);
  failure_ = Shortened(why);
}

void MeshSpans::EndRound() {
  if (!IsActive()) return;
  const std::lock_guard lock(mutex_);
  EndRoundLocked();
}

void MeshSpans::EndRoundLocked() {
  if (!round_) return;
  const TimePoint now = Clock::now();
  ++rounds_;
  if (rounds_ > kMostRounds && now - round_->begun < kLongRound && failure_.empty()) {
    ++rounds_left_out_;
    round_.reset();
    return;
  }
  std::vector<Span> spans = std::move(round_->steps);
  for (Span& chunk : ChunkSpans(now)) spans.push_back(std::move(chunk));
  Span& span = round_->span;
  span.end = WallTime(now);
  span.Add("stellate.chunks", round_->asked);
  if (round_->waited) span.Add("stellate.waited_seconds", *round_->waited);
  if (!failure_.empty()) span.error = failure_;
  spans.push_back(std::move(span));
  round_.reset();
  sink_->Take(std::move(spans));
}

// What is open has no answer: its worker let its time run out, or another was first.
std::vector<Span> MeshSpans::ChunkSpans(TimePoint now) {
  for (auto& [lease, chunk] : std::exchange(round_->open, {})) {
    chunk.done = now;
    Keep(chunk);
  }
  TraceContext within = round_->span.Within();
  within.span = round_->ask_id;
  std::vector<Span> spans;
  for (const Chunk& chunk : round_->kept) {
    Span& span = spans.emplace_back(Begun("chunk", within, chunk.asked, chunk.done));
    span.Add("stellate.worker", chunk.worker);
    span.Add("stellate.queries", chunk.queries);
    span.Add("stellate.outcome", chunk.outcome == nullptr ? "no answer" : chunk.outcome);
    if (chunk.is_check) span.Add("stellate.check", true);
    if (chunk.is_hedge) span.Add("stellate.hedge", true);
    if (chunk.is_lost() && !chunk.is_hedge) span.error = "the worker did not answer";
  }
  return spans;
}

void MeshSpans::Keep(const Chunk& chunk) {
  std::vector<Chunk>& kept = round_->kept;
  const auto matters_more = [](const Chunk& a, const Chunk& b) { return a.MattersMoreThan(b); };
  kept.push_back(chunk);
  std::push_heap(kept.begin(), kept.end(), matters_more);  // in front: what matters least
  if (kept.size() <= kMostChunks) return;
  std::pop_heap(kept.begin(), kept.end(), matters_more);
  kept.pop_back();
}

void MeshSpans::End(const Ending& ending) {
  if (!IsActive()) return;
  const std::lock_guard lock(mutex_);
  if (ending.failure.reason != FailureReason::kNone) failure_ = Shortened(ending.failure.message);
  EndRoundLocked();  // one that an exception ended
  mesh_.end = WallTime(Clock::now());
  mesh_.Add("stellate.state", ending.state);
  mesh_.Add("stellate.rounds", ending.progress.round);
  mesh_.Add("stellate.queries", ending.progress.queries);
  mesh_.Add("stellate.vertices", ending.progress.vertices);
  mesh_.Add("stellate.simplices", ending.progress.simplices);
  mesh_.Add("stellate.certified", ending.report.certificate.certified);
  mesh_.Add("stellate.workers", workers_joined_);
  if (rounds_left_out_ > 0) mesh_.Add("stellate.rounds_left_out", rounds_left_out_);
  if (ending.failure.reason != FailureReason::kNone) {
    mesh_.Add("stellate.reason", FailureReasonName(ending.failure.reason));
    mesh_.error = failure_;
  }
  sink_->Take({mesh_});
}

void MeshSpans::OnJoined(WorkerId worker, const std::string& name, const TraceHeaders& trace) {
  const std::lock_guard lock(mutex_);
  workers_[worker] = {name, trace, Clock::now()};
  ++workers_joined_;
}

// In the trace that the worker came with, or else in the mesh's.
void MeshSpans::OnLeft(WorkerId worker) {
  const std::lock_guard lock(mutex_);
  const auto it = workers_.find(worker);
  if (it == workers_.end()) return;
  const Worker left = std::move(it->second);
  workers_.erase(it);
  const TimePoint now = Clock::now();
  if (round_) {
    for (auto open = round_->open.begin(); open != round_->open.end();) {
      if (open->second.worker != worker) {
        ++open;
        continue;
      }
      Chunk chunk = open->second;
      open = round_->open.erase(open);
      chunk.done = now;
      chunk.outcome = "worker left";
      Keep(chunk);
    }
  }
  if (worker > kMostWorkers) return;
  const auto own = ReadTraceContext(left.trace);
  if (own && !own->sampled) return;
  Span span = Begun("worker", own.value_or(mesh_.Within()), left.joined, now);
  span.is_remote = own.has_value();
  if (own) span.other = mesh_.Within();
  span.Add("stellate.mesh", name_);
  span.Add("stellate.worker", worker);
  if (!left.name.empty()) span.Add("stellate.worker_name", left.name);
  span.Add("stellate.chunks", left.chunks);
  span.Add("stellate.queries", left.queries);
  sink_->Take({std::move(span)});
}

void MeshSpans::OnAsked(const Lease& lease) {
  const std::lock_guard lock(mutex_);
  if (!round_) return;
  ++round_->asked;
  if (!round_->waited) round_->waited = SecondsBetween(round_->step_begun, lease.sent);
  if (round_->open.size() >= kMostOpen) return;
  Chunk& chunk = round_->open[lease.id];
  chunk.worker = lease.worker;
  chunk.queries = lease.count;
  chunk.is_check = lease.check;
  chunk.is_hedge = lease.twin != 0;
  chunk.asked = lease.sent;
}

void MeshSpans::OnAnswered(LeaseId lease, Dispatch::AcceptResult result) {
  const char* const outcome = OutcomeOf(result);
  if (outcome == nullptr) return;
  const std::lock_guard lock(mutex_);
  if (!round_) return;
  const auto it = round_->open.find(lease);
  if (it == round_->open.end()) return;
  Chunk chunk = it->second;
  round_->open.erase(it);
  chunk.done = Clock::now();
  chunk.outcome = outcome;
  const auto worker = workers_.find(chunk.worker);
  if (worker != workers_.end()) {
    ++worker->second.chunks;
    worker->second.queries += chunk.queries;
  }
  Keep(chunk);
}

}  // namespace stellate::server
