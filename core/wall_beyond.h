#pragma once

#include <optional>

#include "core/walls.h"

namespace stellate::core {

// Returns the wall that a point of a face violates most, or nothing if the point is in M. The walls
// of the face itself do not count. `clearances`: of all `walls` at the point.
inline std::optional<int> WallBeyond(const double* clearances, int walls, WallSet face) {
  std::optional<int> beyond;
  for (int wall = 0; wall < walls; ++wall)
    if (clearances[wall] < 0 && !IsSubset(SetOfWall(wall), face) &&
        !(beyond && clearances[*beyond] <= clearances[wall]))
      beyond = wall;
  return beyond;
}

}  // namespace stellate::core
