#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "core/wall_beyond.h"

namespace stellate::core {

// Points of M that were answered, d each, and their clearances from all walls. A point's clearance
// from a wall that it was asked for on is 0 and says nothing.
struct ClearPoints {
  std::vector<double> points, clearances;

  // Adds a point that was asked for on `face`, if it is in M and its clearances are known.
  void Note(const double* y, int d, const double* clear, int walls, WallSet face) {
    if (WallBeyond(clear, walls, face) || !std::isfinite(clear[0])) return;
    points.insert(points.end(), y, y + d);
    clearances.insert(clearances.end(), clear, clear + walls);
    double* const own = clearances.data() + (clearances.size() - static_cast<std::size_t>(walls));
    ForEachWall(face, [&](int wall) { own[wall] = 0; });
  }

  // Halves what is kept, oldest first, once there are more than `most`: what a mesh that does not
  // end is answered is not kept for ever.
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
