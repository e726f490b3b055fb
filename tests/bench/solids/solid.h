#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "tests/core/support/domain.h"

namespace stellate::bench {

using Id = std::uint32_t;
using Curve = std::vector<Eigen::Vector3d>;  // closed if its ends are equal

// A mesh of tetrahedra, by whomever.
struct SolidMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<Id, 4>> cells;
  double seconds = 0;         // of the processor
  double oracle_seconds = 0;  // of these, where it can be told apart
  std::string note;
};

// A bounded domain of R^3 by its walls, and the curves where they meet.
struct Solid {
  const char* name;
  testing::Domain domain;
  double epsilon;
};

// Stellate's core, in this process. `edges`: the curves where walls meet, by four points an edge of
// the mesh.
SolidMesh MeshWithStellate(const Solid& solid, double epsilon, std::vector<Curve>* edges);

// CGAL's make_mesh_3 with the same bound on circumradii (cells and surface balls) and on edges
// along the curves, a radius-edge ratio of 2 and facet angles of 25 degrees; `optimized`: with its
// perturber and exuder, its defaults, against slivers.
SolidMesh MeshWithCgal(const Solid& solid, double epsilon, const std::vector<Curve>& edges,
                       bool optimized);

}  // namespace stellate::bench
