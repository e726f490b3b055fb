#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stellate/mesh.h"

namespace stellate::client {

// Simplices of one dimension that lie on the same walls; on none: the mesh's own, or a region's.
struct Group {
  int tag;           // from 1 on: the mesh's own first, then the boundary's, edges', corners'
  std::string name;  // "inside", or "region_1" of several regions; "wall_0", "walls_0_1", ...
  std::uint64_t walls;
  // (j+1) x m, oriented: the boundary's as the mesh's own induce it, outwards if the mesh fills
  // space; what is between two regions outwards from that of the lower label.
  SimplexMatrix simplices;

  int dimension() const { return static_cast<int>(simplices.rows()) - 1; }
};

// All of a mesh: one group, where it has no boundary.
std::vector<Group> GroupsOf(const Mesh& mesh);
Eigen::Index CountSimplices(const std::vector<Group>& groups);

}  // namespace stellate::client
