#pragma once

#include <limits>

namespace stellate::core::testing {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace stellate::core::testing
