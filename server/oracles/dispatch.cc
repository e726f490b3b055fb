#include "server/oracles/dispatch.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "server/oracles/seconds.h"

namespace stellate::server {
namespace {

using Eigen::Index;

// Seconds: a worker with no more work than this may always have another chunk.
constexpr double kSoon = 0.01;
constexpr double kWorthWhile = 0.1;  // share of a worker's time that a second chunk should save
constexpr double kMostChecked = 16;  // queries at a time

Pace::Chunk Timed(const Lease& lease, TimePoint end) {
  return {static_cast<double>(lease.count), Seconds(end - lease.started), lease.cut,
          Seconds(lease.started - lease.sent)};
}

// Whether only one worker has it, and an idle one would accept it.
bool MayHedge(const Lease& lease, Index capacity) {
  return !lease.check && !lease.answered && lease.twin == 0 && lease.count <= capacity;
}

}  // namespace

int Dispatch::Worker::InFlight() const {
  return static_cast<int>(
      std::count_if(leases.begin(), leases.end(), [](const Lease& l) { return !l.check; }));
}

void Dispatch::Begin(const std::vector<Block>& blocks, TimePoint now) {
  End();
  active_ = true;
  blocks_ = blocks;
  without_worker_since_ = now;
  first_of_round_ = next_lease_;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    Index next = 0;
    const auto ask_until = [&](Index end) {
      if (end <= next) return;
      pending_.push_back({b, next, end - next, 0});
      pending_queries_ += end - next;
      unanswered_ += end - next;
    };
    for (const auto& [first, end] : blocks_[b].answered) {
      ask_until(first);
      next = end;
    }
    ask_until(blocks_[b].queries);
  }
}

void Dispatch::End() {
  active_ = false;
  timed_out_ = false;
  pending_.clear();
  pending_queries_ = 0;
  unanswered_ = 0;
  newest_.reset();
  newest_other_.reset();
  comparisons_.clear();
  for (auto& [id, worker] : workers_) worker.leases.clear();
}

void Dispatch::Join(WorkerId worker, std::uint32_t max_chunk) {
  Worker& joined = workers_[worker];
  joined.max_chunk = max_chunk;
  joined.pace = Pace({Seconds(options_.chunk_target), Seconds(options_.answer_limit)});
}

void Dispatch::Leave(WorkerId worker, TimePoint now) {
  const auto it = workers_.find(worker);
  if (it == workers_.end()) return;
  TakeBack(&it->second, /*timed_out=*/false);
  workers_.erase(it);
  if (workers_.empty()) without_worker_since_ = now;
}

// Its pieces go to the front, since the round may wait for them. Pieces that another worker has
// too, or has answered, need no new lease.
void Dispatch::TakeBack(Worker* worker, bool timed_out) {
  if (worker->leases.empty()) return;
  const WorkerId id = worker->leases.front().worker;
  DropComparisons(id);
  if (newest_ && newest_->worker == id) newest_.reset();
  if (newest_other_ && newest_other_->worker == id) newest_other_.reset();
  for (auto it = worker->leases.rbegin(); it != worker->leases.rend(); ++it) {
    const bool oldest = std::next(it) == worker->leases.rend();
    if (it->check || it->answered) continue;
    // Only the oldest lease had its full time. Several queries may be too many for one chunk.
    const int timeouts = it->timeouts + (timed_out && oldest && it->count == 1 ? 1 : 0);
    if (Lease* const twin = Find(it->twin)) {
      twin->twin = 0;
      twin->timeouts = timeouts;
      continue;
    }
    timed_out_ = timed_out_ || timeouts >= options_.max_leases;
    pending_.push_front({it->block, it->first, it->count, timeouts});
    pending_queries_ += it->count;
  }
  worker->leases.clear();
}

// A single worker takes all. Several get smaller pieces towards the end, so that all finish
// together; pieces below the fixed cost of a chunk would not end the round sooner.
Index Dispatch::ShareOfTheRest(const Worker& worker) const {
  const auto workers = static_cast<Index>(workers_.size());
  if (workers == 1) return pending_queries_;
  const Index share = (pending_queries_ + 2 * workers - 1) / (2 * workers);
  const double least = std::max(Seconds(options_.least_share), worker.pace.fixed());
  const double queries =
      std::min(static_cast<double>(pending_queries_), least / worker.pace.each());
  return std::max(share, static_cast<Index>(queries));
}

// Moves the front of the piece into the lease.
void Dispatch::Cut(const Worker& worker, Piece* piece, Lease* lease) const {
  const std::size_t bytes = std::max<std::size_t>(blocks_[piece->block].bytes_per_query, 1);
  const double most = keeps_blocks_whole_ ? 1e9 : worker.pace.FullChunk();
  auto full = static_cast<Index>(std::min(most, 1e9));
  full = std::min(full, static_cast<Index>(options_.chunk_bytes / bytes));
  if (worker.max_chunk > 0) full = std::min(full, static_cast<Index>(worker.max_chunk));
  full = std::max<Index>(full, 1);
  lease->block = piece->block;
  lease->first = piece->first;
  lease->count = std::min({full, ShareOfTheRest(worker), piece->count});
  lease->cut = lease->count < full;
  lease->timeouts = piece->timeouts;
  piece->first += lease->count;
  piece->count -= lease->count;
}

// A further chunk saves the wait between two. Towards the end of a round it could keep slow queries
// from workers that are idle sooner.
bool Dispatch::MayHaveAnother(const Worker& worker) const {
  const int in_flight = worker.InFlight();
  if (in_flight == 0) return true;
  const Pace& pace = worker.pace;
  if (in_flight >= options_.max_in_flight || worker.Lagging() || !pace.is_calibrated())
    return false;
  const auto workers = static_cast<double>(workers_.size());
  if (workers == 1 || static_cast<double>(pending_queries_) > 2 * workers * pace.FullChunk())
    return true;
  double held = 0;
  for (const Lease& lease : worker.leases) held += pace.Seconds(static_cast<double>(lease.count));
  return held <= std::max(kSoon, pace.fixed() / kWorthWhile);
}

// The worker with the fewest chunks; of these the fastest, or one with unknown pace. A lagging
// worker is chosen only if there is no other, and gets one chunk at a time.
Dispatch::Worker* Dispatch::PickWorker(WorkerId* id) {
  const bool any_lively = std::any_of(workers_.begin(), workers_.end(),
                                      [](const auto& entry) { return !entry.second.Lagging(); });
  Worker* best = nullptr;
  for (auto& [candidate_id, candidate] : workers_) {
    if (candidate.Lagging() && any_lively) continue;
    if (!MayHaveAnother(candidate)) continue;
    const int in_flight = candidate.InFlight();
    const bool better =
        best == nullptr || in_flight < best->InFlight() ||
        (in_flight == best->InFlight() && candidate.pace.Seconds(1) < best->pace.Seconds(1));
    if (!better) continue;
    best = &candidate;
    *id = candidate_id;
  }
  return best;
}

Lease* Dispatch::Find(LeaseId id) {
  if (id == 0) return nullptr;
  for (auto& [worker_id, worker] : workers_) {
    for (Lease& lease : worker.leases) {
      if (lease.id == id) return &lease;
    }
  }
  return nullptr;
}

Lease Dispatch::Give(WorkerId id, Lease lease, TimePoint now) {
  lease.id = next_lease_++;
  lease.worker = id;
  lease.sent = lease.started = now;
  Worker& worker = workers_.at(id);
  worker.leases.push_back(lease);
  worker.unanswered.insert(lease.id);
  if (!lease.check) worker.newest_chunk = static_cast<std::uint64_t>(lease.count);
  return lease;
}

std::vector<Lease> Dispatch::Assign(TimePoint now) {
  std::vector<Lease> leases;
  WorkerId id = 0;
  while (active_ && !pending_.empty()) {
    Worker* const worker = PickWorker(&id);
    if (worker == nullptr) break;
    // Before its own chunk, so that the comparison does not end later than that.
    const Family family = blocks_[pending_.front().block].family;
    for (Comparison& comparison : comparisons_)
      if (comparison.check == 0 && comparison.worker != id &&
          blocks_[comparison.block].family == family && !IsCompared(id, family) &&
          !IsCheckingFamily(id, family))
        leases.push_back(AskToCompare(&comparison, id, now));
    if (const auto check = NextCheck(id, worker)) {
      worker->check_credit -= static_cast<double>(check->count);
      leases.push_back(Give(id, *check, now));
    }
    Lease lease;
    Cut(*worker, &pending_.front(), &lease);
    pending_queries_ -= lease.count;
    if (pending_.front().count == 0) pending_.pop_front();
    lease = Give(id, lease, now);
    leases.push_back(lease);
    RequireComparison(lease);
    const double earned = options_.check_share * static_cast<double>(lease.count);
    worker->check_credit = std::min(worker->check_credit + earned, kMostChecked);
    if (newest_ && newest_->worker != id) newest_other_ = newest_;
    newest_ = lease;
  }
  for (Comparison& comparison : comparisons_)
    if (const auto checker = PickChecker(comparison))
      leases.push_back(AskToCompare(&comparison, *checker, now));
  if (active_ && pending_.empty()) Hedge(now, &leases);
  return leases;
}

TimePoint Dispatch::OverdueAt(const Worker& worker, std::size_t position) const {
  const Pace* pace = &worker.pace;
  for (const auto& [id, other] : workers_) {
    if (worker.pace.known() || !other.pace.known()) continue;
    if (!pace->known() || other.pace.Seconds(1) < pace->Seconds(1)) pace = &other.pace;
  }
  const TimePoint started = worker.leases.front().started;
  if (!pace->known()) return started + options_.hedge_unknown;
  double expected = 0;
  for (std::size_t i = 0; i <= position; ++i) {
    expected += pace->AtMost(static_cast<double>(worker.leases[i].count));
  }
  const double patience = std::min(options_.hedge_factor * expected, 1e6);
  return started + std::max(options_.hedge_floor, std::chrono::duration_cast<Clock::duration>(
                                                      std::chrono::duration<double>(patience)));
}

Index Dispatch::IdleCapacity() const {
  Index capacity = 0;
  for (const auto& [id, worker] : workers_) {
    if (!worker.Idle()) continue;
    if (worker.max_chunk == 0) return std::numeric_limits<Index>::max();
    capacity = std::max(capacity, static_cast<Index>(worker.max_chunk));
  }
  return capacity;
}

// Gives overdue chunks, oldest first, to idle workers, fastest first.
void Dispatch::Hedge(TimePoint now, std::vector<Lease>* leases) {
  while (const Index capacity = IdleCapacity()) {
    Lease* overdue = nullptr;
    for (auto& [id, worker] : workers_) {
      for (std::size_t i = 0; i < worker.leases.size(); ++i) {
        Lease& lease = worker.leases[i];
        if (overdue != nullptr && overdue->id < lease.id) continue;
        if (MayHedge(lease, capacity) && OverdueAt(worker, i) <= now) overdue = &lease;
      }
    }
    if (overdue == nullptr) return;
    WorkerId best = 0;
    for (const auto& [id, worker] : workers_) {
      if (!worker.Idle() || !worker.Wants(overdue->count)) continue;
      if (best == 0 || worker.pace.Seconds(1) < workers_.at(best).pace.Seconds(1)) best = id;
    }
    Lease copy = *overdue;
    copy.twin = overdue->id;
    leases->push_back(Give(best, copy, now));
    overdue->twin = leases->back().id;
    RequireComparison(leases->back());
  }
}

Dispatch::AcceptResult Dispatch::Accept(WorkerId worker_id, LeaseId id, TimePoint now,
                                        Lease* lease) {
  const auto entry = workers_.find(worker_id);
  if (entry == workers_.end()) return AcceptResult::kLate;
  Worker& worker = entry->second;
  if (worker.unanswered.erase(id) == 0) return AcceptResult::kUnknown;
  worker.stalled = false;
  const auto it = std::find_if(worker.leases.begin(), worker.leases.end(),
                               [id](const Lease& l) { return l.id == id; });
  if (it == worker.leases.end()) return AcceptResult::kLate;
  *lease = *it;
  worker.answered_queries += static_cast<std::uint64_t>(lease->count);
  ++worker.answered_chunks;
  const bool oldest = it == worker.leases.begin();
  worker.leases.erase(it);
  // A cross-check of a few queries does not show the pace.
  if (!lease->check) worker.pace.Answered(Timed(*lease, now));
  if (oldest && !worker.leases.empty()) worker.leases.front().started = now;  // the next in line
  for (Comparison& comparison : comparisons_)
    comparison.has_answer = comparison.has_answer || comparison.check == id;
  if (lease->check || lease->answered) return AcceptResult::kForComparison;
  const auto covers = [&](const Comparison& comparison) {
    return comparison.block == lease->block && comparison.first >= lease->first &&
           comparison.first < lease->first + lease->count;
  };
  // The comparison of a slower worker is dropped: its answer does not count.
  std::erase_if(comparisons_,
                [&](const Comparison& d) { return covers(d) && d.worker != worker_id; });
  for (Comparison& comparison : comparisons_)
    comparison.answered = comparison.answered || covers(comparison);
  if (Lease* const twin = Find(lease->twin)) {
    twin->answered = true;
    twin->twin = 0;
  }
  return AcceptResult::kCounts;
}

void Dispatch::MarkAnswered(LeaseId id, Index count) {
  if (active_ && id >= first_of_round_) unanswered_ -= count;
}

void Dispatch::Busy(WorkerId worker_id, LeaseId id, TimePoint now) {
  const auto entry = workers_.find(worker_id);
  if (entry == workers_.end()) return;
  Worker& worker = entry->second;
  worker.pace.MayTake(Seconds(std::max(options_.busy_limit, options_.answer_limit)));
  for (Lease& lease : worker.leases) {
    if (lease.id == id) lease.heard = now;
  }
}

// REQUIRES: the lease's time runs.
TimePoint Dispatch::EndOf(const Lease& lease) const {
  const TimePoint silent = lease.started + options_.answer_limit;
  if (lease.heard <= lease.started) return silent;
  return std::min(lease.heard + options_.answer_limit,
                  std::max(silent, lease.started + options_.busy_limit));
}

void Dispatch::Expire(TimePoint now) {
  for (auto& [id, worker] : workers_) {
    if (worker.leases.empty()) continue;
    if (now < EndOf(worker.leases.front())) continue;
    worker.stalled = true;
    keeps_blocks_whole_ = false;
    worker.pace.BeginAgain();
    TakeBack(&worker, /*timed_out=*/true);
  }
}

Dispatch::Failure Dispatch::failure(TimePoint now) const {
  if (!active_) return Failure::kNone;
  if (timed_out_) return Failure::kAnswerTimeout;
  // A piece that is accepted but not marked yet is being checked: its worker's answer still counts.
  if (workers_.empty() && pending_queries_ > 0 &&
      now - without_worker_since_ >= options_.worker_wait) {
    return Failure::kNoWorker;
  }
  return Failure::kNone;
}

TimePoint Dispatch::NextDeadline() const {
  TimePoint next = TimePoint::max();
  if (!active_) return next;
  if (workers_.empty()) next = without_worker_since_ + options_.worker_wait;
  const Index capacity = pending_.empty() ? IdleCapacity() : 0;
  for (const auto& [id, worker] : workers_) {
    if (worker.leases.empty()) continue;
    next = std::min(next, EndOf(worker.leases.front()));
    for (std::size_t i = 0; capacity > 0 && i < worker.leases.size(); ++i) {
      if (MayHedge(worker.leases[i], capacity)) next = std::min(next, OverdueAt(worker, i));
    }
  }
  // The end of the wait for comparisons.
  std::optional<TimePoint> last;
  for (const Comparison& comparison : comparisons_)
    if (const auto until = ComparisonDeadline(comparison))
      last = std::max(last.value_or(*until), *until);
  if (last && unanswered_ == 0) next = std::min(next, *last);
  return next;
}

}  // namespace stellate::server
