#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/certificate/mesh_view.h"

namespace stellate::core {

// The size of some simplices of one dimension together, and the sharpest of their angles.
struct Together {
  double volume = 0;  // length^dimension; of points: how many they are
  // The least angle between two facets of a simplex, within it: of triangles the angles at their
  // corners, of tetrahedra the dihedral angles. 0: degenerate, or the dimension is below 2.
  double min_dihedral_degrees = 0;
};

// Returns the volume of simplices together, dimension + 1 ids each. The sum does not depend on the
// number of threads.
double MeasureVolume(const MeshView& mesh, int dimension,
                     const std::vector<std::uint32_t>& simplices);
// Measures their angles, too.
Together MeasureTogether(const MeshView& mesh, int dimension,
                         const std::vector<std::uint32_t>& simplices);

// Whether two volumes are the same, except the rounding of sums over all simplices.
inline bool AreSameVolumes(double one, double other) {
  constexpr double kRounding = 1e-9;
  return std::abs(one - other) <= kRounding * std::max(std::abs(one), std::abs(other));
}

// Returns the volume that an oriented closed surface encloses, by the divergence theorem.
// `simplices`: d ids each; `turned`: those whose normals, as the order of their ids has them, point
// inwards.
double EnclosedVolume(const MeshView& mesh, const std::vector<std::uint32_t>& simplices,
                      const std::vector<bool>& turned);

}  // namespace stellate::core
