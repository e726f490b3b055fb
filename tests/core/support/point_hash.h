#pragma once

#include <Eigen/Core>
#include <bit>
#include <cstdint>

#include "core/base/random.h"

namespace stellate::core::testing {

// A number in [0, 1) that depends on a point alone: what a test lets happen here and there.
inline double PointHash(const Eigen::VectorXd& x) {
  std::uint64_t h = 0;
  for (Eigen::Index i = 0; i < x.size(); ++i) h = Mix64(h ^ std::bit_cast<std::uint64_t>(x[i]));
  return static_cast<double>(h >> 11) * 0x1p-53;
}

}  // namespace stellate::core::testing
