#pragma once

#include <cstdint>
#include <string>

namespace stellate::server {

// What the server has measured of one worker, for people. Get it from OraclePool::ListWorkers.
struct WorkerStats {
  std::uint64_t id = 0;
  std::string display_name;        // from its Hello, and its address
  std::uint64_t queries = 0;       // answered in time
  std::uint64_t chunks = 0;        // answered in time
  double fixed_seconds = 0;        // its measured time for n queries is fixed + each * n
  double each_seconds = 0;         // 0, like fixed_seconds: not known yet
  std::uint64_t unanswered = 0;    // queries sent to it and not answered yet
  std::uint64_t newest_chunk = 0;  // queries in its newest chunk
  bool lagging = false;  // let a lease run out, or still computes what is no longer needed
};

}  // namespace stellate::server
