// What Dispatch has answered twice, so that workers can be compared.
#include <algorithm>
#include <utility>

#include "server/oracles/dispatch.h"

namespace stellate::server {
namespace {

using Eigen::Index;

// Multiplicative hashing: a different place in each chunk, the same in each run.
Index Scatter(LeaseId id, Index range) {
  return static_cast<Index>((id * 0x9e3779b97f4a7c15u >> 33) % static_cast<std::uint64_t>(range));
}

}  // namespace

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

bool Dispatch::IsCompared(WorkerId worker, const Family& family) const {
  const auto it = workers_.find(worker);
  return it != workers_.end() && it->second.compared.contains(family);
}

// It was given these.
void Dispatch::Owe(const Lease& lease) {
  const Family& family = blocks_[lease.block].family;
  const bool owes = std::any_of(debts_.begin(), debts_.end(), [&](const Debt& debt) {
    return debt.worker == lease.worker && blocks_[debt.block].family == family;
  });
  if (options_.check_share <= 0 || owes || IsCompared(lease.worker, family)) return;
  debts_.push_back({lease.worker, lease.block, lease.first + Scatter(lease.id, lease.count)});
}

// Its leases go to others: what it owes is theirs to owe, and what it was to compare is for others.
// What it answered before still counts, and is compared though it is gone.
void Dispatch::Forget(WorkerId worker) {
  std::erase_if(debts_, [&](const Debt& d) { return d.worker == worker && !d.answered; });
  for (Debt& debt : debts_)
    if (debt.checker == worker && !debt.taken) debt.check = debt.checker = 0;
}

// By another's debt.
bool Dispatch::IsBeingCompared(WorkerId worker, const Family& family) const {
  return std::any_of(debts_.begin(), debts_.end(), [&](const Debt& debt) {
    return debt.check != 0 && debt.checker == worker && blocks_[debt.block].family == family;
  });
}

// Who owes himself is the better for it, then who has the least to do.
std::optional<WorkerId> Dispatch::PickChecker(const Debt& debt) const {
  const Family& family = blocks_[debt.block].family;
  if (debt.check != 0 || IsBeingCompared(debt.worker, family)) return {};
  std::optional<WorkerId> best;
  std::pair<bool, std::size_t> least;
  for (const auto& [id, worker] : workers_) {
    const bool beaten = std::any_of(worker.leases.begin(), worker.leases.end(),
                                    [](const Lease& lease) { return lease.answered; });
    if (id == debt.worker || worker.Lagging() || beaten) continue;
    const std::pair<bool, std::size_t> load(worker.compared.contains(family), worker.leases.size());
    if (best && load >= least) continue;
    best = id;
    least = load;
  }
  return best;
}

Lease Dispatch::AskToCompare(Debt* debt, WorkerId checker, TimePoint now) {
  Lease check;
  check.check = true;
  check.block = debt->block;
  check.first = debt->query;
  check.count = 1;
  check = Give(checker, check, now);
  debt->check = check.id;
  debt->checker = checker;
  return check;
}

// As long as for a straggler: whoever is far slower than his pace promises may hang.
std::optional<TimePoint> Dispatch::Patience(const Debt& debt) const {
  if (debt.taken) return TimePoint::max();
  const auto it = workers_.find(debt.checker);
  if (debt.check == 0 || it == workers_.end()) return {};
  const auto& leases = it->second.leases;
  for (std::size_t i = 0; i < leases.size(); ++i)
    if (leases[i].id == debt.check) return OverdueAt(it->second, i);
  return {};
}

bool Dispatch::Done(TimePoint now) const {
  if (!active_ || unsettled_ > 0) return false;
  return std::none_of(debts_.begin(), debts_.end(), [&](const Debt& debt) {
    const auto until = Patience(debt);
    return until ? now < *until : PickChecker(debt).has_value();
  });
}

void Dispatch::Compared(WorkerId a, WorkerId b, std::size_t block) {
  if (!active_) return;
  const Family& family = blocks_[block].family;
  for (const WorkerId id : {a, b}) {
    const auto it = workers_.find(id);
    if (it != workers_.end()) it->second.compared.insert(family);
    std::erase_if(debts_, [&](const Debt& debt) {
      return debt.worker == id && blocks_[debt.block].family == family;
    });
  }
}

}  // namespace stellate::server
