#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace stellate::core {

// The 2-skeleton of a small connected complex, which decides its fundamental group and its first
// homology. Edges name vertices 0..vertices-1; triangles name edges.
struct TwoSkeleton {
  std::uint32_t vertices = 0;
  std::vector<std::array<std::uint32_t, 2>> edges;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

enum class LoopVerdict {
  kSimplyConnected,  // proved: each loop contracts
  kNoHomology,       // H_1 over Z/2 vanishes; whether each loop contracts was not decided
  kHasHomology,      // H_1 over Z/2 does not vanish: not simply connected
};

// Decides by the edge-path group: edges outside a spanning tree generate it, triangles are the
// relations. A triangle with two edges known to be trivial makes the third one trivial; trees grown
// from each vertex in turn are tried until all edges are trivial. If no tree succeeds, ranks over
// Z/2 decide.
LoopVerdict ClassifyLoops(const TwoSkeleton& skeleton);

}  // namespace stellate::core
