// Cross-checks: which queries Dispatch has answered twice.
#include <algorithm>
#include <utility>

#include "server/oracles/dispatch.h"

namespace stellate::server {
namespace {

using Eigen::Index;

// Queries of a worker's first comparison. Two walls, or two manifolds, are equally far from some
// places, and one query can be such a place.
constexpr Index kComparedAtFirst = 8;

// Multiplicative hashing: a different place in each chunk, the same in each run.
Index Scatter(LeaseId id, Index range) {
  return static_cast<Index>((id * 0x9e3779b97f4a7c15u >> 33) % static_cast<std::uint64_t>(range));
}

}  // namespace

// Of `count` queries, as many as the worker takes in one chunk.
Index Dispatch::MostAtATime(const Worker& worker, std::size_t block, Index count) const {
  if (!worker.Wants(count)) count = static_cast<Index>(worker.max_chunk);
  const std::size_t bytes = std::max<std::size_t>(blocks_[block].bytes_per_query, 1);
  return std::clamp<Index>(static_cast<Index>(options_.chunk_bytes / bytes), 1, count);
}

// Some queries of another worker's newest chunk, if it is time to ask `worker` any.
std::optional<Lease> Dispatch::NextCheck(WorkerId id, Worker* worker) const {
  if (options_.check_share <= 0 || worker->check_credit < 1 || worker->Lagging()) return {};
  const auto& other = newest_ && newest_->worker != id ? newest_ : newest_other_;
  if (!other || other->worker == id) return {};
  const Index n = MostAtATime(*worker, other->block,
                              std::min(static_cast<Index>(worker->check_credit), other->count));
  Lease check;
  check.check = true;
  check.block = other->block;
  check.first = other->first + Scatter(next_lease_, other->count - n + 1);
  check.count = n;
  return check;
}

bool Dispatch::IsCompared(WorkerId worker, const Family& family) const {
  const auto it = workers_.find(worker);
  return it != workers_.end() && it->second.compared.contains(family);
}

// After a worker received a lease.
void Dispatch::RequireComparison(const Lease& lease) {
  const Family& family = blocks_[lease.block].family;
  const bool is_required =
      std::any_of(comparisons_.begin(), comparisons_.end(), [&](const Comparison& comparison) {
        return comparison.worker == lease.worker && blocks_[comparison.block].family == family;
      });
  if (options_.check_share <= 0 || is_required || IsCompared(lease.worker, family)) return;
  const Index n = std::min(kComparedAtFirst, lease.count);
  const Index first = lease.first + Scatter(lease.id, lease.count - n + 1);
  comparisons_.push_back({lease.worker, lease.block, first, n});
}

// Its leases go to other workers, and so do the comparisons of them. Answers that it gave before
// still count, and are compared although it has left.
void Dispatch::DropComparisons(WorkerId worker) {
  std::erase_if(comparisons_,
                [&](const Comparison& d) { return d.worker == worker && !d.answered; });
  for (Comparison& comparison : comparisons_)
    if (comparison.checker == worker && !comparison.has_answer)
      comparison.check = comparison.checker = 0;
}

// Whether the worker is the checker of another worker's comparison.
bool Dispatch::IsCheckingFamily(WorkerId worker, const Family& family) const {
  return std::any_of(comparisons_.begin(), comparisons_.end(), [&](const Comparison& comparison) {
    return comparison.check != 0 && comparison.checker == worker &&
           blocks_[comparison.block].family == family;
  });
}

// Prefers a worker that needs a comparison itself, then the one with the fewest leases.
std::optional<WorkerId> Dispatch::PickChecker(const Comparison& comparison) const {
  const Family& family = blocks_[comparison.block].family;
  if (comparison.check != 0 || IsCheckingFamily(comparison.worker, family)) return {};
  std::optional<WorkerId> best;
  std::pair<bool, std::size_t> least;
  for (const auto& [id, worker] : workers_) {
    const bool beaten = std::any_of(worker.leases.begin(), worker.leases.end(),
                                    [](const Lease& lease) { return lease.answered; });
    if (id == comparison.worker || worker.Lagging() || beaten) continue;
    const std::pair<bool, std::size_t> load(worker.compared.contains(family), worker.leases.size());
    if (best && load >= least) continue;
    best = id;
    least = load;
  }
  return best;
}

Lease Dispatch::AskToCompare(Comparison* comparison, WorkerId checker, TimePoint now) {
  Lease check;
  check.check = true;
  check.block = comparison->block;
  check.first = comparison->first;
  check.count = MostAtATime(workers_.at(checker), comparison->block, comparison->count);
  check = Give(checker, check, now);
  comparison->check = check.id;
  comparison->checker = checker;
  return check;
}

// Until the check is overdue: a worker far slower than its pace may hang.
std::optional<TimePoint> Dispatch::ComparisonDeadline(const Comparison& comparison) const {
  if (comparison.has_answer) return TimePoint::max();
  const auto it = workers_.find(comparison.checker);
  if (comparison.check == 0 || it == workers_.end()) return {};
  const auto& leases = it->second.leases;
  for (std::size_t i = 0; i < leases.size(); ++i)
    if (leases[i].id == comparison.check) return OverdueAt(it->second, i);
  return {};
}

bool Dispatch::Done(TimePoint now) const {
  if (!active_ || unanswered_ > 0) return false;
  return std::none_of(comparisons_.begin(), comparisons_.end(), [&](const Comparison& comparison) {
    const auto until = ComparisonDeadline(comparison);
    return until ? now < *until : PickChecker(comparison).has_value();
  });
}

void Dispatch::Compared(WorkerId a, WorkerId b, std::size_t block) {
  if (!active_) return;
  const Family& family = blocks_[block].family;
  for (const WorkerId id : {a, b}) {
    const auto it = workers_.find(id);
    if (it != workers_.end()) it->second.compared.insert(family);
    std::erase_if(comparisons_, [&](const Comparison& comparison) {
      return comparison.worker == id && blocks_[comparison.block].family == family;
    });
  }
}

}  // namespace stellate::server
