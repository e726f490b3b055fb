#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "core/wall_beyond.h"

namespace stellate::core {

// Points of M that were answered, d each, and their clearances from all walls. The clearance is 0,
// without meaning, for a wall on whose face the point was queried.
struct ClearPoints {
  std::vector<double> points, clearances;

  // Adds a point that was queried on `face`, if it is in M and its clearances are known.
  void Note(const double* y, int d, const double* clear, int walls, WallSet face) {
    if (WallBeyond(clear, walls, face) || !std::isfinite(clear[0])) return;
    points.insert(points.end(), y, y + d);
    clearances.insert(clearances.end(), clear, clear + walls);
    double* const own = clearances.data() + (clearances.size() - static_cast<std::size_t>(walls));
    ForEachWall(face, [&](int wall) { own[wall] = 0; });
  }

  // Drops the oldest points once there are more than `most`, down to half of that: a mesh that
  // never ends does not fill the memory.
  void KeepNewest(std::size_t most, std::size_t d) {
    const std::size_t count = points.size() / d;
    if (count <= most) return;
    const std::size_t gone = count - most / 2, walls = clearances.size() / count;
    points.erase(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(gone * d));
    clearances.erase(clearances.begin(),
                     clearances.begin() + static_cast<std::ptrdiff_t>(gone * walls));
  }
};

}  // namespace stellate::core
