#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/certificate/complex/topology.h"

namespace stellate::core {

// The vertex links of a complex. A complex whose vertex links are all (k-1)-spheres is a closed
// k-manifold.
struct LinkReport {
  std::uint64_t bad_links = 0;
  std::vector<std::uint32_t> some_bad;  // the first Violations::kMost of these vertices
  std::string first_bad_link;           // plain words; empty if none
  // Whether every link called a sphere is known to be one. For k <= 3 always: the link is closed,
  // connected, and has Euler characteristic 2 if it is a surface. For k = 4 and 5 a link is decided
  // if its own vertex links are spheres and it is found to be simply connected (a sphere then, by
  // Perelman and, up to homeomorphism, Freedman); if that search gives up, the link merely has the
  // homology of a sphere over Z/2.
  bool decided_exactly = true;
  std::int64_t euler_characteristic = 0;  // of the whole complex
};

// Checks all vertex links, except that of `ignored`. Time linear in the mesh for bounded stars.
LinkReport CheckLinks(const Adjacency& adjacency, std::uint32_t ignored = Adjacency::kNone);

}  // namespace stellate::core
