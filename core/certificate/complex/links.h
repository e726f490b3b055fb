#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/certificate/complex/topology.h"

namespace stellate::core {

// What the vertex links say of a complex. A complex whose vertex links are all (k-1)-spheres is a
// closed k-manifold.
struct LinkReport {
  std::uint64_t bad_links = 0;
  std::vector<std::uint32_t> some_bad;  // the first Violations::kMost of these vertices
  std::string first_bad_link;           // plain words; empty if none
  // Every link called a sphere is one. For k <= 3 always: closed, connected, and of Euler
  // characteristic 2 when it is a surface. For k = 4 and 5 a link is decided when, its own vertex
  // links being spheres, it is seen to be simply connected (a sphere then, by Perelman and, up to
  // homeomorphism, Freedman); where that search gives up, the link merely has the homology of a
  // sphere over Z/2.
  bool decided_exactly = true;
  std::int64_t euler_characteristic = 0;  // of the whole complex
};

// Time linear in the mesh for bounded stars. `ignored`: a vertex whose link may be anything.
LinkReport CheckLinks(const Adjacency& adjacency, std::uint32_t ignored = Adjacency::kNone);

}  // namespace stellate::core
