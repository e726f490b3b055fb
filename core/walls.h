#pragma once

#include <bit>
#include <cstdint>

namespace stellate::core {

// A manifold with boundary is M = { x in M^ : g_i(x) >= 0 for all walls i }, M^ without boundary.
// The walls are transversal on M: where several meet, their conormals are linearly independent.
//
// The face M_I is the part of M where the walls of I are 0: M itself for no wall, a part of the
// boundary for one, edges and corners for more. Its dimension is k - |I|. A WallSet is such a set
// I, a bit for each wall.
using WallSet = std::uint64_t;

inline constexpr int kMaxWalls = 64;

inline constexpr WallSet SetOfWall(int wall) { return WallSet{1} << wall; }
inline constexpr int CountWalls(WallSet walls) { return std::popcount(walls); }
inline constexpr bool IsSubset(WallSet part, WallSet whole) { return (part & ~whole) == 0; }

// Calls visit(wall) for each wall of the set, ascending.
template <typename Visit>
void ForEachWall(WallSet walls, const Visit& visit) {
  for (; walls != 0; walls &= walls - 1) visit(std::countr_zero(walls));
}

// The facets of a cell that lie in walls have ids above those of sample points.
inline constexpr std::uint32_t kFirstWallId = 0xffffff00u;
inline constexpr std::uint32_t IdOfWall(int wall) {
  return kFirstWallId + static_cast<std::uint32_t>(wall);
}
inline constexpr bool IsWall(std::uint32_t id) { return id - kFirstWallId < kMaxWalls; }
inline constexpr bool IsSample(std::uint32_t id) { return id < kFirstWallId; }
inline constexpr int WallOf(std::uint32_t id) { return static_cast<int>(id - kFirstWallId); }

// One sentence for messages: what to do if a manifold that is meshed without walls ends, or may
// end.
inline constexpr const char* kDeclareWalls =
    "If the manifold has a boundary, it has to be declared by walls: see \"Boundaries and "
    "domains\" in the documentation";

}  // namespace stellate::core
