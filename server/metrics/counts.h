#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "server/session/session.h"

namespace stellate::server {

// Totals over all meshes of a server.
struct Counts {
  std::map<SessionState, std::uint64_t> states;  // meshes in each of them, all states
  std::uint64_t workers = 0, watchers = 0, vertices = 0;
  std::uint64_t waiting = 0;  // queries without an answer yet
  std::uint64_t bytes = 0;    // estimated
  std::uint64_t idle = 0;     // meshes that have queries and no worker
};

Counts CountAll(const std::vector<std::shared_ptr<Session>>& sessions);

}  // namespace stellate::server
