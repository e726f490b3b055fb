#pragma once

#include <cstdint>
#include <vector>

#include "core/reconstruction/fitted_cloud.h"

namespace stellate::core {

// Tangent spaces from differences of points that lie on M, with a bound of their error that holds
// for every M ("Tangents by differences", docs/using/proof.md); that of a fitted quadric has none.
//
// A neighbour q of p is no farther than |q - p|^2 / 2 reach from T_pM (Federer). So the unit
// vectors towards m neighbours are columns of A = A_T + E, A_T in T_pM and |E|^2 <= sum |q - p|^2 /
// 4 reach^2. For a unit n normal to M, |A^t n| <= |E|; and |A^t n| >= sigma_k |P n|, P the
// projection on the span of the k largest singular directions, which are orthogonal for A as well.
// So the sine of the angle between that span and T_pM is at most |E| / sigma_k.
struct DifferenceTangents {
  std::vector<double> tangents;  // by point of the cloud, k rows of d each
  // The sine of the angle is at most this over the reach, at the points asked for; length.
  double error_length = 0;
};

// `asked`: by point, 1: its error counts.
DifferenceTangents FindDifferenceTangents(const FittedCloud& cloud,
                                          const std::vector<std::uint8_t>& asked);

}  // namespace stellate::core
