#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "core/base/random.h"

namespace stellate::core::bench {

// A random sample of the product of K unit circles, padded with zeros to R^D: points of D
// coordinates, and tangent bases of K rows of D, as Stars takes them.
template <int K, int D = 2 * K>
struct FlatTorus {
  static_assert(D >= 2 * K);
  std::vector<double> points, tangents;

  explicit FlatTorus(int n) {
    Random random(11);
    for (int i = 0; i < n; ++i) {
      std::array<double, K> angle;
      for (double& a : angle) a = 2 * std::numbers::pi * random.Uniform();
      std::array<double, D> point{};
      for (int a = 0; a < K; ++a) {
        point[2 * a] = std::cos(angle[a]);
        point[2 * a + 1] = std::sin(angle[a]);
      }
      points.insert(points.end(), point.begin(), point.end());
      for (int a = 0; a < K; ++a) {
        std::array<double, D> tangent{};
        tangent[2 * a] = -std::sin(angle[a]);
        tangent[2 * a + 1] = std::cos(angle[a]);
        tangents.insert(tangents.end(), tangent.begin(), tangent.end());
      }
    }
  }

  const double* Point(int i) const { return &points[static_cast<std::size_t>(i) * D]; }
  const double* Tangent(int i) const { return &tangents[static_cast<std::size_t>(i) * D * K]; }
};

}  // namespace stellate::core::bench
