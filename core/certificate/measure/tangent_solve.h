#pragma once

#include <algorithm>
#include <array>
#include <type_traits>

#include "core/base/vector_ops.h"
#include "core/certificate/measure/small_solve.h"

namespace stellate::core {

template <int K>
using Columns = std::array<const double*, K>;  // of a K x K matrix

// The sign of the columns' determinant, and |determinant| times the solution of columns . b = ray;
// 0 when the determinant is within rounding of zero, as SmallSystem says.
template <int K>
int Solve(const Columns<K>& u, const std::array<double, K>& ray, std::array<double, K>& b) {
  SmallSystem system;
  for (int r = 0; r < K; ++r) {
    for (int c = 0; c < K; ++c) system.a[r][c] = u[c][r];
    system.b[r] = ray[r];
  }
  const int sign = system.Solve(std::integral_constant<int, K>{});
  std::copy_n(system.b.begin(), K, b.begin());
  return sign;
}

// By Cramer's rule.
template <>
inline int Solve<2>(const Columns<2>& u, const std::array<double, 2>& ray,
                    std::array<double, 2>& b) {
  const double determinant = u[0][0] * u[1][1] - u[0][1] * u[1][0];
  const double lengths2 =
      (u[0][0] * u[0][0] + u[0][1] * u[0][1]) * (u[1][0] * u[1][0] + u[1][1] * u[1][1]);
  if (!IsTellingDeterminant(determinant, lengths2)) return 0;
  const int sign = determinant > 0 ? 1 : -1;
  b[0] = sign * (ray[0] * u[1][1] - ray[1] * u[1][0]);
  b[1] = sign * (u[0][0] * ray[1] - u[0][1] * ray[0]);
  return sign;
}

inline std::array<double, 3> Cross(const double* a, const double* b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <>
inline int Solve<3>(const Columns<3>& u, const std::array<double, 3>& ray,
                    std::array<double, 3>& b) {
  const std::array<std::array<double, 3>, 3> normals{Cross(u[1], u[2]), Cross(u[2], u[0]),
                                                     Cross(u[0], u[1])};
  const double determinant = Dot(u[0], normals[0].data(), 3);
  double lengths2 = 1;
  for (const double* column : u) lengths2 *= Dot(column, column, 3);
  if (!IsTellingDeterminant(determinant, lengths2)) return 0;
  const int sign = determinant > 0 ? 1 : -1;
  for (int c = 0; c < 3; ++c) b[c] = sign * Dot(ray.data(), normals[c].data(), 3);
  return sign;
}

}  // namespace stellate::core
