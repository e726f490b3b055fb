#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/rules/violation.h"

namespace stellate::core {

// A violation of star `star` that a round may remove by a point near star + T_star x.
template <int K>
struct Target {
  std::uint32_t star = 0;
  Violation<K> violation;
  double x[K] = {};       // where to insert, tangent coordinates: the circumcentre, or less far out
  double radius = 0;      // |x|
  double size_bound = 0;  // of R1 for the star, length

  // Whether the simplex is so large, above twice its bound, that M may be anywhere between.
  bool is_coarse() const { return violation.radius > 2 * size_bound; }
};

// Returns where to insert for a violation: at the circumcentre, but no farther out than the advance
// step, and, in a coarse mesh, nearer after each failed attempt.
template <int K>
Target<K> TargetFor(std::uint32_t star, const Violation<K>& violation, double size_bound,
                    double advance_step, int failed_attempts) {
  Target<K> target;
  target.star = star;
  target.violation = violation;
  target.size_bound = size_bound;
  // Many steps have exactly the longest length allowed: otherwise rounding would decide their
  // order.
  target.radius = violation.radius;
  if (violation.rule < Rule::kShape) {
    target.radius = std::min(target.radius, advance_step);
    if (target.is_coarse()) target.radius = std::ldexp(target.radius, -failed_attempts);
  }
  const double scale = target.radius / violation.radius;
  for (int a = 0; a < K; ++a) target.x[a] = violation.x[a] * scale;
  return target;
}

}  // namespace stellate::core
