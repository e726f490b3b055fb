#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/certificate/mesh_view.h"

namespace stellate::core {

// Compares all points of M that the oracle answered, for any purpose, with a finished mesh. A point
// y of M and the tangent space at a vertex p bound the reach from above: reach <= |y - p|^2 / (2
// dist(y, T_pM)) (Federer). A mesh as coarse as that may have merged the sheets of y and p. A point
// with no vertex near lies on a part of M that the mesh misses.

// How near, in mesh sizes, every point of M has a vertex if the mesh covers M: its simplex's
// circumradius and height, and as much again.
inline constexpr double kCoverageShare = 2;

struct Evidence {
  static constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();

  double reach = std::numeric_limits<double>::infinity();  // at most; length
  double coarseness = 0;                 // the largest local circumradius over the bound there
  std::uint64_t narrowest = kNone;       // the given point y of that bound; kNone: a vertex
  std::uint32_t vertex = 0;              // the vertex p of that bound
  double distance = 0;                   // |y - p|
  std::vector<std::uint64_t> uncovered;  // points with no vertex near, ascending
};

// Compares `points` (d each, C order) with the mesh, and about `vertices` of the mesh's own
// vertices, evenly spread, with the others. Time linear in both.
//
//   longest_edge    of each vertex, length
//   size            the mesh's, length; for a `graded` mesh a vertex's longest edge is used instead
//   position_error  of the oracle's answers, as measured, length
Evidence CompareWithMesh(const MeshView& mesh, const std::vector<double>& points,
                         const std::vector<double>& longest_edge, double size, bool graded,
                         double position_error, std::uint64_t vertices);

}  // namespace stellate::core
