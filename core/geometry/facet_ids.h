#pragma once

#include <cstdint>

#include "core/walls.h"

namespace stellate::core {

// The id of a cell's facet says what it lies in: the bisector of p and the sample point of that id,
// a wall, or the fake simplex that a cell begins as.
inline constexpr std::uint32_t kFirstWallId = 0xffffff00u;
inline constexpr std::uint32_t kFirstFakeId = 0xfffffff0u;

inline constexpr bool IsSample(std::uint32_t id) { return id < kFirstWallId; }
inline constexpr bool IsWall(std::uint32_t id) { return id - kFirstWallId < kMaxWalls; }
inline constexpr bool IsFake(std::uint32_t id) { return id >= kFirstFakeId; }

inline constexpr std::uint32_t IdOfWall(int wall) {
  return kFirstWallId + static_cast<std::uint32_t>(wall);
}
// REQUIRES: IsWall(id)
inline constexpr int WallOf(std::uint32_t id) { return static_cast<int>(id - kFirstWallId); }

}  // namespace stellate::core
