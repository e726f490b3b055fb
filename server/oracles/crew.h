#pragma once

#include <cstdint>
#include <string>

namespace stellate::server {

// What a worker has done and does, for people.
struct CrewMember {
  std::uint64_t id = 0;
  std::string title;          // as it called itself, and where it is
  std::uint64_t queries = 0;  // answered in time
  std::uint64_t chunks = 0;   // that these came in
  double fixed_seconds = 0;   // its time for n queries, as measured: fixed + each * n
  double each_seconds = 0;    // 0, as is fixed_seconds: nothing is known yet
  std::uint64_t holds = 0;    // queries that it has been asked and has not answered
  std::uint64_t newest = 0;   // queries of the chunk that it was asked last
  bool lagging = false;       // let a chunk run out, or is at one that nobody waits for
};

}  // namespace stellate::server
