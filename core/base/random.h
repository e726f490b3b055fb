#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace stellate::core {

// SplitMix64's finaliser: a bijection of 64-bit words that scatters neighbouring inputs.
inline std::uint64_t Mix64(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

// A small deterministic generator. Streams with different keys are independent, so that what one
// star draws never depends on what another drew.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t key = 0) : state_(Mix64(seed) ^ Mix64(~key)) {}

  std::uint64_t Next() { return Mix64(state_++); }
  // In [0, 1).
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1p-53; }
  // Standard normal (Box and Muller).
  double Normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * Uniform());
  }

 private:
  std::uint64_t state_;
};

}  // namespace stellate::core
