#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stellate/mesh.h"

namespace stellate::client {

// Simplices of one dimension that lie on the same walls; on none: the mesh's own, or a region's.
struct Group {
  int tag;  // from 1 on: the mesh's own first, then the boundary's, edges', corners'
  // "inside", or the region's name, "region_1" if it has none; "wall_0", "walls_0_1", ...
  std::string name;
  std::uint64_t walls;
  // (j+1) x m, oriented: the boundary's as the mesh's own induce it, outwards if the mesh fills
  // space; what is between two regions outwards from that of the lower label.
  SimplexMatrix simplices;
  int label = 0;  // of the region that it is; else 0
  // Of a mesh with labels, m: of faces of dimension k - 1 the labels that each faces away from and
  // faces. Else empty.
  std::vector<Sides> sides = {};

  int dimension() const { return static_cast<int>(simplices.rows()) - 1; }
};

// All of a mesh: one group, where it has no boundary. Its simplices may be those alone that have a
// vertex on a wall: then so are those of the regions, and the faces are those of the whole mesh,
// which has the labels `known`, too.
std::vector<Group> GroupsOf(const Mesh& mesh, const std::vector<std::uint8_t>& known = {});

// A name without what file formats take for something else: .obj has spaces between names of
// groups, .msh quotes around them. "region_1" where there is none, or another region has it, too.
std::string RegionName(int label, const std::vector<std::string>& names);

// Of walls as bits: "wall_0", "walls_0_1", ...; of none "".
std::string WallName(std::uint64_t walls);

}  // namespace stellate::client
