#pragma once

namespace stellate::core {

// Returns base^exponent by multiplication, the same on every processor, unlike std::pow. REQUIRES:
// exponent >= 0.
inline double Power(double base, int exponent) {
  double power = 1;
  for (int i = 0; i < exponent; ++i) power *= base;
  return power;
}

}  // namespace stellate::core
