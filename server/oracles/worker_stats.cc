#include "server/oracles/worker_stats.h"

#include <algorithm>

#include "core/base/message.h"
#include "server/oracles/dispatch.h"
#include "server/oracles/oracle_pool.h"

namespace stellate::server {

std::vector<WorkerStats> Dispatch::ListWorkers() const {
  std::vector<WorkerStats> workers;
  for (const auto& [id, worker] : workers_) {
    WorkerStats& member = workers.emplace_back();
    member.id = id;
    member.queries = worker.answered_queries;
    member.chunks = worker.answered_chunks;
    if (worker.pace.known()) {
      member.fixed_seconds = worker.pace.fixed();
      member.each_seconds = worker.pace.each();
    }
    for (const Lease& lease : worker.leases) {
      member.unanswered += static_cast<std::uint64_t>(lease.count);
    }
    member.newest_chunk = worker.newest_chunk;
    member.lagging = worker.Lagging();
  }
  return workers;
}

std::vector<WorkerStats> OraclePool::ListWorkers() const {
  const std::lock_guard lock(mutex_);
  std::vector<WorkerStats> workers = dispatch_.ListWorkers();
  for (WorkerStats& member : workers) member.display_name = display_names_.at(member.id);
  return workers;
}

std::string OraclePool::WhoAnswered() const {
  const std::vector<WorkerStats> workers = ListWorkers();
  const auto answered = std::count_if(workers.begin(), workers.end(),
                                      [](const WorkerStats& worker) { return worker.queries > 0; });
  if (answered < 2) return "";
  return core::Message("; ", answered,
                       " workers have answered: if each is right by itself, they serve different "
                       "manifolds");
}

}  // namespace stellate::server
