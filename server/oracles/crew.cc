#include "server/oracles/crew.h"

#include "server/oracles/dispatch.h"
#include "server/oracles/oracle_pool.h"

namespace stellate::server {

std::vector<CrewMember> Dispatch::Crew() const {
  std::vector<CrewMember> crew;
  for (const auto& [id, worker] : workers_) {
    CrewMember& member = crew.emplace_back();
    member.id = id;
    member.queries = worker.answered_queries;
    member.chunks = worker.answered_chunks;
    if (worker.pace.known()) {
      member.fixed_seconds = worker.pace.fixed();
      member.each_seconds = worker.pace.each();
    }
    for (const Lease& lease : worker.leases) {
      member.holds += static_cast<std::uint64_t>(lease.count);
    }
    member.newest = worker.newest_chunk;
    member.lagging = worker.Lagging();
  }
  return crew;
}

std::vector<CrewMember> OraclePool::Crew() const {
  const std::lock_guard lock(mutex_);
  std::vector<CrewMember> crew = dispatch_.Crew();
  for (CrewMember& member : crew) member.title = titles_.at(member.id);
  return crew;
}

}  // namespace stellate::server
