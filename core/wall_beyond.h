#pragma once

#include <optional>

#include "core/walls.h"

namespace stellate::core {

// The wall that a point of a face lies beyond, of those that the face is not on: by the most. None:
// the point is in M. `clearances`: of all `walls` at the point.
inline std::optional<int> WallBeyond(const double* clearances, int walls, WallSet face) {
  std::optional<int> beyond;
  for (int wall = 0; wall < walls; ++wall)
    if (clearances[wall] < 0 && !IsSubset(SetOfWall(wall), face) &&
        !(beyond && clearances[*beyond] <= clearances[wall]))
      beyond = wall;
  return beyond;
}

}  // namespace stellate::core
