#pragma once

#include <vector>

#include "core/complex/sectors.h"
#include "core/geometry/corner_cone.h"

namespace stellate::core {

// At a corner of an arrangement more walls may be zero than are independent in K dimensions, as at
// an octahedron's corner: then not all of their signs occur together. Those that some direction
// from the corner has are found from the walls' conormals alone.
//
//   walls      those that are zero at the corner; K of them are independent
//   conormals  K numbers for each of them, ascending: outward, unit
//   signs      of all other walls

// Returns the signs of all walls that some direction has, in descending order.
template <int K>
std::vector<WallSet> SignsAround(WallSet walls, const double* conormals, WallSet signs);

// Returns the sectors of these signs that are in M.
template <int K>
std::vector<Sector> CornerSectors(const LabelTable& labels, WallSet walls, const double* conormals,
                                  WallSet signs);

// Returns the cone of the directions with these signs, or of those alone which the walls of
// `bounds` leave.
template <int K>
CornerCone<K> ConeOfSector(WallSet walls, const double* conormals, const Sector& sector);

}  // namespace stellate::core
