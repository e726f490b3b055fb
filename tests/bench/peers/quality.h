#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "stellate/catalogue.h"

namespace stellate::bench {

// What can be said of anybody's mesh, by the catalogue's knowledge of the manifold and by none of
// Stellate's mesher.
struct Quality {
  // Largest distance to M, length, of the vertices and of the barycentres of all faces of dimension
  // 1 to k. The other half of the Hausdorff distance, from M to the mesh, is no larger when the
  // closest-point map carries the mesh onto M, as it does a closed one that stays near M.
  double hausdorff = 0;
  double min_angle_degrees = 0;  // of the triangles; k = 2 only
  double min_fatness = 0;        // least vol_k / diam^k of the k-simplices
  std::int64_t euler_characteristic = 0;
  // Each (k-1)-face is in exactly two k-simplices, each vertex in some, and the Euler
  // characteristic is that of M. Necessary for a right mesh, not sufficient. Clipped: the faces in
  // one simplex alone are a closed complex themselves, and the Euler characteristic is a ball's.
  bool closed = false;
};

// points: D x n with D at least the dimension of M's space, which is that of the first coordinates;
// simplices: k+1 vertex numbers each. `clip`: of a sphere's part beyond it along PoleOf it, whose
// boundary's vertices and barycentres are measured from where it ends, too.
Quality MeasureQuality(Manifold& manifold, const Eigen::MatrixXd& points,
                       const std::vector<std::uint32_t>& simplices,
                       std::optional<double> clip = std::nullopt);

// A point of M, as unit vector.
Eigen::VectorXd PoleOf(Manifold& manifold);

}  // namespace stellate::bench
