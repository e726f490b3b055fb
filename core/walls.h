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
//
//   const WallSet edge = SetOfWall(0) | SetOfWall(2);  // where walls 0 and 2 meet
//   ForEachWall(edge, [&](int wall) { walls.push_back(wall); });
using WallSet = std::uint64_t;

inline constexpr int kMaxWalls = 64;
inline constexpr int kNoWall = -1;

inline constexpr WallSet SetOfWall(int wall) { return WallSet{1} << wall; }
inline constexpr int CountWalls(WallSet walls) { return std::popcount(walls); }
inline constexpr bool IsSubset(WallSet part, WallSet whole) { return (part & ~whole) == 0; }

// Calls visit(wall) for each wall of the set, ascending.
template <typename Visit>
void ForEachWall(WallSet walls, const Visit& visit) {
  for (; walls != 0; walls &= walls - 1) visit(std::countr_zero(walls));
}

}  // namespace stellate::core
