#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace stellate::shapes {

// Of (x, y), without overflow or underflow. Not std::hypot: it rounds as the C library has it, and
// would be all that asks for a glibc of 2022.
inline double Length(double x, double y) {
  const double squared = x * x + y * y;
  const bool is_exact =
      squared > 0x1p52 * std::numeric_limits<double>::min() && std::isfinite(squared);
  return is_exact ? std::sqrt(squared) : Eigen::Vector2d(x, y).stableNorm();
}

}  // namespace stellate::shapes
