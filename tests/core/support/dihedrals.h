#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace stellate::testing {

// The least and the largest dihedral angle of a tetrahedron in R^d, degrees.
inline std::pair<double, double> DihedralAnglesOf(const std::array<Eigen::VectorXd, 4>& corners) {
  double least = 180, largest = 0;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      // Seen along the edge from i to j, the angle between the other two.
      const Eigen::VectorXd edge = (corners[j] - corners[i]).normalized();
      std::array<Eigen::VectorXd, 2> across;
      for (std::size_t v = 0, n = 0; v < 4; ++v) {
        if (v == i || v == j) continue;
        const Eigen::VectorXd to = corners[v] - corners[i];
        across[n++] = (to - to.dot(edge) * edge).normalized();
      }
      const double cosine = std::clamp(across[0].dot(across[1]), -1.0, 1.0);
      const double angle = std::acos(cosine) * 180 / std::numbers::pi;
      least = std::min(least, angle);
      largest = std::max(largest, angle);
    }
  return {least, largest};
}

}  // namespace stellate::testing
