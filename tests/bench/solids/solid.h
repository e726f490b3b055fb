#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/core/support/domain.h"

namespace stellate::bench {

using Id = std::uint32_t;
using Curve = std::vector<Eigen::Vector3d>;  // closed if its ends are equal

// A mesh of tetrahedra, by whomever.
struct SolidMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<Id, 4>> cells;
  std::vector<int> labels;    // of the cells
  double seconds = 0;         // of the processor
  double oracle_seconds = 0;  // of these, where it can be told apart
  std::string note;
};

// A bounded domain of R^3 by its walls: what is positive of all of them, or, with `label`, the
// regions of an arrangement, 0 outside.
struct Solid {
  std::string name;
  testing::Domain domain;
  double epsilon;
  std::function<int(core::WallSet signs)> label;

  int LabelAt(const Eigen::Vector3d& x) const {
    core::WallSet signs = 0, all = 0;
    for (std::size_t w = 0; w < domain.walls.size(); ++w) {
      const core::WallSet wall = core::SetOfWall(static_cast<int>(w));
      all |= wall;
      if (domain.walls[w](x, nullptr) > 0) signs |= wall;
    }
    return label ? std::max(label(signs), 0) : signs == all ? 1 : 0;
  }
};

// Stellate's core, in this process. `edges`: the curves where walls meet, by four points an edge of
// the mesh.
SolidMesh MeshWithStellate(const Solid& solid, double epsilon, std::vector<Curve>* edges);

// CGAL's make_mesh_3 with the same bound on circumradii (cells and surface balls) and on edges
// along the curves, a radius-edge ratio of 2 and facet angles of 25 degrees; `optimized`: with its
// perturber and exuder, its defaults, against slivers. Without `edges` it is not told where they
// are.
SolidMesh MeshWithCgal(const Solid& solid, double epsilon, const std::vector<Curve>& edges,
                       bool optimized);

}  // namespace stellate::bench
