#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/certificate/mesh_view.h"

namespace stellate::core {

// Holds points of M that were answered, whatever for, against a finished mesh. A point y of M and
// the tangent space at a vertex p bound the reach from above: reach <= |y - p|^2 / (2 dist(y,
// T_pM)) (Federer). A mesh as coarse as that may have merged what y and p lie on. And a point with
// no vertex near lies on a part of M that the mesh misses.

// How near, in mesh sizes, a point of M has a vertex of a mesh that is M: its simplex' circumradius
// and height, and as much again.
inline constexpr double kCoverageShare = 2;

struct Evidence {
  static constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();

  double reach = std::numeric_limits<double>::infinity();  // at most; length
  double coarseness = 0;            // the largest local circumradius over the bound there
  std::uint64_t narrowest = kNone;  // the point, among those given, that says so; kNone: a vertex
  std::uint32_t vertex = 0;         // and the vertex that it says it of
  double distance = 0;              // between them
  std::vector<std::uint64_t> uncovered;  // points with no vertex near, ascending
};

// `points`: d each, C order. `longest_edge`: by vertex. `size`: the mesh's, the same everywhere but
// where it is `graded`: there, what a vertex's longest edge says. `position_error`: of the oracle's
// answers, as seen. Of the mesh's own vertices about `vertices`, evenly spread, are held against
// the others too. Time linear in both.
Evidence CompareWithMesh(const MeshView& mesh, const std::vector<double>& points,
                         const std::vector<double>& longest_edge, double size, bool graded,
                         double position_error, std::uint64_t vertices);

}  // namespace stellate::core
