#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/walls.h"

namespace stellate::core {

// The cone that the walls at a corner leave of its tangent space, from their conormals. K
// independent walls have a facet of it each. If more walls meet, as at an octahedron's corner, or
// where a level set passes through the corner of a box, some may have none.
inline constexpr int kMostAtCorner = 16;
template <int K>
struct CornerCone {
  // The direction in which an edge of M leaves the corner.
  struct Ray {
    Eigen::Matrix<double, K, 1> along;  // unit
    WallSet walls;                      // of the edge
  };
  std::vector<Ray> rays;  // none: M is only the corner there
  WallSet walls = 0;      // the walls that have a facet of it
  bool has_interior = false;
  bool is_simple = false;  // it has an interior, and K - 1 walls meet along each ray
  WallSet crowded = 0;     // if not simple: more than K - 1 walls that meet along one ray; or none
};

// Returns the cone. `conormals`: K numbers for each of the walls, ascending, outward and unit.
// REQUIRES: K > 1; K of them are independent; there are kMostAtCorner at most.
template <int K>
CornerCone<K> ConeOf(WallSet walls, const double* conormals);

}  // namespace stellate::core
