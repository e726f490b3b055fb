#include "core/geometry/reach.h"

#include <cmath>

#include "core/base/infinity.h"

namespace stellate::core {
namespace {

constexpr int kBisections = 60;  // beyond the digits of a double

}  // namespace

double LargestDistance(double rho, double reach) {
  if (!(rho < reach)) return kInfinity;
  // Without the difference, which would lose digits.
  return rho * rho / (reach + std::sqrt((reach - rho) * (reach + rho)));
}

double SineOfHalfTurn(double rho, double reach) {
  return (rho + LargestDistance(rho, reach)) / (2 * reach);
}

double LargestTurn(double rho, double reach) {
  const double sine = SineOfHalfTurn(rho, reach);
  return sine < 1 ? 2 * std::asin(sine) : kInfinity;
}

double RadiusThatTurns(double turn, double reach) {
  return RadiusOfHalfTurn(std::sin(turn / 2), reach);
}

double RadiusOfHalfTurn(double sine, double reach) {
  double low = 0, high = reach;
  for (int step = 0; step < kBisections; ++step) {
    const double middle = (low + high) / 2;
    (SineOfHalfTurn(middle, reach) <= sine ? low : high) = middle;
  }
  return low;
}

double JungRatio(int k) { return std::sqrt(k / (2.0 * k + 2)); }

}  // namespace stellate::core
