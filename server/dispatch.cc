#include "server/dispatch.h"

#include <algorithm>
#include <utility>

namespace stellate::server {
namespace {

using Eigen::Index;

constexpr Index kFirstChunk = 64;     // for a worker of unknown speed: a dear oracle must not choke
constexpr Index kSmallestChunk = 16;  // below that the message costs more than its queries
constexpr double kSpeedMemory = 0.5;  // weight of the past in the running mean of a speed

}  // namespace

void Dispatch::Begin(const std::vector<Block>& blocks, TimePoint now) {
  End();
  active_ = true;
  blocks_ = blocks;
  deserted_since_ = now;
  first_of_round_ = next_lease_;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const Index n = blocks_[b].queries;
    if (n == 0) continue;
    pending_.push_back({b, 0, n, 0});
    pending_queries_ += n;
    unsettled_ += n;
  }
}

void Dispatch::End() {
  active_ = false;
  timed_out_ = false;
  pending_.clear();
  pending_queries_ = 0;
  unsettled_ = 0;
  for (auto& [id, worker] : workers_) worker.leases.clear();
}

void Dispatch::Join(WorkerId worker, std::uint32_t max_chunk) {
  workers_[worker].max_chunk = max_chunk;
}

void Dispatch::Leave(WorkerId worker, TimePoint now) {
  const auto it = workers_.find(worker);
  if (it == workers_.end()) return;
  TakeBack(&it->second, /*timed_out=*/false);
  workers_.erase(it);
  if (workers_.empty()) deserted_since_ = now;
}

// Its pieces go to the front: others may be waiting for just these.
void Dispatch::TakeBack(Worker* worker, bool timed_out) {
  for (auto it = worker->leases.rbegin(); it != worker->leases.rend(); ++it) {
    const bool oldest = std::next(it) == worker->leases.rend();
    Piece piece{it->block, it->first, it->count, it->timeouts};
    pending_queries_ += piece.count;
    if (!timed_out || !oldest) {
      pending_.push_front(piece);
      continue;
    }
    // Only the oldest had its time. Perhaps it was too much at once: try it in two halves.
    ++piece.timeouts;
    timed_out_ = timed_out_ || piece.timeouts >= options_.max_leases;
    const Index half = piece.count / 2;
    if (half > 0) {
      pending_.push_front({piece.block, piece.first + half, piece.count - half, piece.timeouts});
      piece.count = half;
    }
    pending_.push_front(piece);
  }
  worker->leases.clear();
}

Index Dispatch::ChunkSize(const Worker& worker, const Piece& piece) const {
  const auto crew = static_cast<Index>(workers_.size());
  // Alone, a worker takes all. Among many, smaller pieces towards the end let all end together.
  Index n = crew == 1 ? pending_queries_ : (pending_queries_ + 2 * crew - 1) / (2 * crew);
  n = std::max(n, kSmallestChunk);
  if (worker.speed > 0) {
    const double target = std::chrono::duration<double>(options_.chunk_target).count();
    const double fits = std::min(worker.speed * target, 1e9);
    n = std::min(n, std::max<Index>(static_cast<Index>(fits), 1));
  } else {
    n = std::min(n, kFirstChunk);
  }
  const std::size_t bytes = std::max<std::size_t>(blocks_[piece.block].bytes_per_query, 1);
  n = std::min(n, static_cast<Index>(options_.chunk_bytes / bytes));
  if (worker.max_chunk > 0) n = std::min(n, static_cast<Index>(worker.max_chunk));
  return std::clamp<Index>(n, 1, piece.count);
}

// The worker with the fewest chunks, the fastest of these. One that let a lease run out is asked
// again only when there is no other, and for one chunk at a time.
Dispatch::Worker* Dispatch::PickWorker(WorkerId* id) {
  const bool any_lively = std::any_of(workers_.begin(), workers_.end(),
                                      [](const auto& entry) { return !entry.second.stalled; });
  Worker* best = nullptr;
  for (auto& [candidate_id, candidate] : workers_) {
    if (candidate.stalled && any_lively) continue;
    const std::size_t limit = candidate.stalled ? 1 : options_.max_in_flight;
    if (candidate.leases.size() >= limit) continue;
    const bool better =
        best == nullptr || candidate.leases.size() < best->leases.size() ||
        (candidate.leases.size() == best->leases.size() && candidate.speed > best->speed);
    if (!better) continue;
    best = &candidate;
    *id = candidate_id;
  }
  return best;
}

std::vector<Lease> Dispatch::Assign(TimePoint now) {
  std::vector<Lease> leases;
  WorkerId id = 0;
  while (active_ && !pending_.empty()) {
    Worker* const worker = PickWorker(&id);
    if (worker == nullptr) break;
    Piece& piece = pending_.front();
    const Index n = ChunkSize(*worker, piece);
    const Lease lease{next_lease_++, id, piece.block, piece.first, n, piece.timeouts, now};
    piece.first += n;
    piece.count -= n;
    pending_queries_ -= n;
    if (piece.count == 0) pending_.pop_front();
    worker->leases.push_back(lease);
    ++worker->unanswered;
    leases.push_back(lease);
  }
  return leases;
}

Dispatch::ClaimResult Dispatch::Claim(WorkerId worker_id, LeaseId id, TimePoint now, Lease* lease) {
  const auto entry = workers_.find(worker_id);
  if (entry == workers_.end()) return ClaimResult::kLate;
  Worker& worker = entry->second;
  if (id == 0 || id >= next_lease_ || worker.unanswered == 0) return ClaimResult::kUnknown;
  --worker.unanswered;
  worker.stalled = false;
  const auto it = std::find_if(worker.leases.begin(), worker.leases.end(),
                               [id](const Lease& l) { return l.id == id; });
  if (it == worker.leases.end()) return ClaimResult::kLate;
  *lease = *it;
  const bool oldest = it == worker.leases.begin();
  worker.leases.erase(it);
  const double seconds = std::chrono::duration<double>(now - lease->started).count();
  const double speed = static_cast<double>(lease->count) / std::max(seconds, 1e-6);
  worker.speed =
      worker.speed > 0 ? kSpeedMemory * worker.speed + (1 - kSpeedMemory) * speed : speed;
  if (oldest && !worker.leases.empty()) worker.leases.front().started = now;  // the next in line
  return ClaimResult::kClaimed;
}

void Dispatch::Settle(const Lease& lease) {
  if (active_ && lease.id >= first_of_round_) unsettled_ -= lease.count;
}

void Dispatch::Expire(TimePoint now) {
  for (auto& [id, worker] : workers_) {
    if (worker.leases.empty()) continue;
    if (now - worker.leases.front().started < options_.answer_limit) continue;
    worker.stalled = true;
    TakeBack(&worker, /*timed_out=*/true);
  }
}

Dispatch::Failure Dispatch::failure(TimePoint now) const {
  if (!active_) return Failure::kNone;
  if (timed_out_) return Failure::kAnswerTimeout;
  // A piece claimed but not yet settled is being checked: that worker's answer still counts.
  if (workers_.empty() && pending_queries_ > 0 && now - deserted_since_ >= options_.worker_wait) {
    return Failure::kNoWorker;
  }
  return Failure::kNone;
}

TimePoint Dispatch::NextDeadline() const {
  TimePoint next = TimePoint::max();
  if (!active_) return next;
  if (workers_.empty()) next = deserted_since_ + options_.worker_wait;
  for (const auto& [id, worker] : workers_) {
    if (worker.leases.empty()) continue;
    next = std::min(next, worker.leases.front().started + options_.answer_limit);
  }
  return next;
}

}  // namespace stellate::server
