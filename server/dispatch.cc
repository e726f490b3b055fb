#include "server/dispatch.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace stellate::server {
namespace {

using Eigen::Index;

constexpr Index kFirstChunk = 64;     // for a worker of unknown speed: a dear oracle must not choke
constexpr Index kSmallestChunk = 16;  // below that the message costs more than its queries
constexpr double kSpeedMemory = 0.5;  // weight of the past in the running mean of a speed
constexpr double kMostChecked = 16;   // queries at a time

double Seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

// Multiplicative hashing: a different place in each chunk, the same in each run.
Index Scatter(LeaseId id, Index range) {
  return static_cast<Index>((id * 0x9e3779b97f4a7c15u >> 33) % static_cast<std::uint64_t>(range));
}

// One worker at a time answers it, and one with room for it is idle.
bool MayBackUp(const Lease& lease, Index room) {
  return !lease.check && !lease.answered && lease.twin == 0 && lease.count <= room;
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
  deserted_since_ = now;
  first_of_round_ = next_lease_;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    Index next = 0;
    const auto ask_until = [&](Index end) {
      if (end <= next) return;
      pending_.push_back({b, next, end - next, 0});
      pending_queries_ += end - next;
      unsettled_ += end - next;
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
  unsettled_ = 0;
  newest_.reset();
  newest_other_.reset();
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

// Its pieces go to the front: others may be waiting for just these. What another worker has too,
// or has answered, is that one's business.
void Dispatch::TakeBack(Worker* worker, bool timed_out) {
  if (worker->leases.empty()) return;
  const WorkerId id = worker->leases.front().worker;
  if (newest_ && newest_->worker == id) newest_.reset();
  if (newest_other_ && newest_other_->worker == id) newest_other_.reset();
  for (auto it = worker->leases.rbegin(); it != worker->leases.rend(); ++it) {
    const bool oldest = std::next(it) == worker->leases.rend();
    if (it->check || it->answered) continue;
    if (Lease* const twin = Find(it->twin)) {
      twin->twin = 0;
      twin->timeouts = it->timeouts + (timed_out && oldest ? 1 : 0);
      continue;
    }
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
    const double fits = std::min(worker.speed * Seconds(options_.chunk_target), 1e9);
    n = std::min(n, std::max<Index>(static_cast<Index>(fits), 1));
  } else {
    n = std::min(n, kFirstChunk);
  }
  const std::size_t bytes = std::max<std::size_t>(blocks_[piece.block].bytes_per_query, 1);
  n = std::min(n, static_cast<Index>(options_.chunk_bytes / bytes));
  if (worker.max_chunk > 0) n = std::min(n, static_cast<Index>(worker.max_chunk));
  return std::clamp<Index>(n, 1, piece.count);
}

// The worker with the fewest chunks, the fastest of these. One that lags is asked only when there
// is no other, and for one chunk at a time.
Dispatch::Worker* Dispatch::PickWorker(WorkerId* id) {
  const bool any_lively = std::any_of(workers_.begin(), workers_.end(),
                                      [](const auto& entry) { return !entry.second.Lagging(); });
  Worker* best = nullptr;
  for (auto& [candidate_id, candidate] : workers_) {
    const bool lags = candidate.Lagging();
    if (lags && any_lively) continue;
    const int in_flight = candidate.InFlight();
    if (in_flight >= (lags ? 1 : options_.max_in_flight)) continue;
    const bool better = best == nullptr || in_flight < best->InFlight() ||
                        (in_flight == best->InFlight() && candidate.speed > best->speed);
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
  lease.started = now;
  Worker& worker = workers_.at(id);
  worker.leases.push_back(lease);
  ++worker.unanswered;
  return lease;
}

std::vector<Lease> Dispatch::Assign(TimePoint now) {
  std::vector<Lease> leases;
  WorkerId id = 0;
  while (active_ && !pending_.empty()) {
    Worker* const worker = PickWorker(&id);
    if (worker == nullptr) break;
    // Before its own chunk, which then cannot be used before the check is.
    if (const auto check = NextCheck(id, worker)) {
      worker->check_credit -= static_cast<double>(check->count);
      leases.push_back(Give(id, *check, now));
    }
    Piece& piece = pending_.front();
    Lease lease;
    lease.block = piece.block;
    lease.first = piece.first;
    lease.count = ChunkSize(*worker, piece);
    lease.timeouts = piece.timeouts;
    piece.first += lease.count;
    piece.count -= lease.count;
    pending_queries_ -= lease.count;
    if (piece.count == 0) pending_.pop_front();
    lease = Give(id, lease, now);
    leases.push_back(lease);
    const double earned = options_.check_share * static_cast<double>(lease.count);
    worker->check_credit = std::min(worker->check_credit + earned, kMostChecked);
    if (newest_ && newest_->worker != id) newest_other_ = newest_;
    newest_ = lease;
  }
  if (active_ && pending_.empty()) BackUp(now, &leases);
  return leases;
}

// Some queries of another worker's newest chunk, if it is time to ask `worker` any.
std::optional<Lease> Dispatch::NextCheck(WorkerId id, Worker* worker) const {
  if (options_.check_share <= 0 || worker->check_credit < 1 || worker->Lagging()) return {};
  const auto& other = newest_ && newest_->worker != id ? newest_ : newest_other_;
  if (!other || other->worker == id) return {};
  Index n = std::min(static_cast<Index>(worker->check_credit), other->count);
  if (!worker->Wants(n)) n = static_cast<Index>(worker->max_chunk);
  const std::size_t bytes = std::max<std::size_t>(blocks_[other->block].bytes_per_query, 1);
  n = std::clamp<Index>(static_cast<Index>(options_.chunk_bytes / bytes), 1, n);
  Lease check;
  check.check = true;
  check.block = other->block;
  check.first = other->first + Scatter(next_lease_, other->count - n + 1);
  check.count = n;
  return check;
}

TimePoint Dispatch::OverdueAt(const Worker& worker, std::size_t position) const {
  double speed = worker.speed;
  if (speed <= 0) {
    for (const auto& [id, other] : workers_) speed = std::max(speed, other.speed);
  }
  const TimePoint started = worker.leases.front().started;
  if (speed <= 0) return started + options_.straggler_unknown;
  Index queries = 0;
  for (std::size_t i = 0; i <= position; ++i) queries += worker.leases[i].count;
  const double expected = std::max(static_cast<double>(queries) / speed,
                                   worker.least_seconds * static_cast<double>(position + 1));
  const double patience = std::min(options_.straggler_factor * expected, 1e6);
  return started + std::max(options_.straggler_floor, std::chrono::duration_cast<Clock::duration>(
                                                          std::chrono::duration<double>(patience)));
}

Index Dispatch::IdleRoom() const {
  Index room = 0;
  for (const auto& [id, worker] : workers_) {
    if (!worker.Idle()) continue;
    if (worker.max_chunk == 0) return std::numeric_limits<Index>::max();
    room = std::max(room, static_cast<Index>(worker.max_chunk));
  }
  return room;
}

// Stragglers, oldest first, to idle workers, fastest first.
void Dispatch::BackUp(TimePoint now, std::vector<Lease>* leases) {
  while (const Index room = IdleRoom()) {
    Lease* straggler = nullptr;
    for (auto& [id, worker] : workers_) {
      for (std::size_t i = 0; i < worker.leases.size(); ++i) {
        Lease& lease = worker.leases[i];
        if (straggler != nullptr && straggler->id < lease.id) continue;
        if (MayBackUp(lease, room) && OverdueAt(worker, i) <= now) straggler = &lease;
      }
    }
    if (straggler == nullptr) return;
    WorkerId best = 0;
    for (const auto& [id, worker] : workers_) {
      if (!worker.Idle() || !worker.Wants(straggler->count)) continue;
      if (best == 0 || worker.speed > workers_.at(best).speed) best = id;
    }
    Lease copy = *straggler;
    copy.twin = straggler->id;
    leases->push_back(Give(best, copy, now));
    straggler->twin = leases->back().id;
  }
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
  if (!lease->check) {  // a handful of queries says nothing of its speed
    const double seconds = std::max(Seconds(now - lease->started), 1e-6);
    const double speed = static_cast<double>(lease->count) / seconds;
    worker.least_seconds = worker.speed > 0 ? std::min(worker.least_seconds, seconds) : seconds;
    worker.speed =
        worker.speed > 0 ? kSpeedMemory * worker.speed + (1 - kSpeedMemory) * speed : speed;
  }
  if (oldest && !worker.leases.empty()) worker.leases.front().started = now;  // the next in line
  if (lease->check || lease->answered) return ClaimResult::kSecond;
  if (Lease* const twin = Find(lease->twin)) {
    twin->answered = true;
    twin->twin = 0;
  }
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
  const Index room = pending_.empty() ? IdleRoom() : 0;
  for (const auto& [id, worker] : workers_) {
    if (worker.leases.empty()) continue;
    next = std::min(next, worker.leases.front().started + options_.answer_limit);
    for (std::size_t i = 0; room > 0 && i < worker.leases.size(); ++i) {
      if (MayBackUp(worker.leases[i], room)) next = std::min(next, OverdueAt(worker, i));
    }
  }
  return next;
}

}  // namespace stellate::server
