#pragma once

namespace stellate::core {

// base^exponent by multiplication: std::pow rounds as the processor has it. REQUIRES: exponent >=
// 0.
inline double Power(double base, int exponent) {
  double power = 1;
  for (int i = 0; i < exponent; ++i) power *= base;
  return power;
}

}  // namespace stellate::core
