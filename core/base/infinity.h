#pragma once

#include <limits>

namespace stellate::core {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace stellate::core
