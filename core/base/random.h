#pragma once

#include <cstdint>

namespace stellate::core {

// SplitMix64's finaliser: a bijection of 64-bit words that scatters neighbouring inputs.
inline std::uint64_t Mix64(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

// A small deterministic generator, the same on every processor, unlike one that uses libm. Streams
// with different keys are independent, so that the numbers of one star never depend on those of
// another.
//
//   Random random(seed, star);
//   const double u = random.Uniform();
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t key = 0) : state_(Mix64(seed) ^ Mix64(~key)) {}

  std::uint64_t Next() { return Mix64(state_++); }
  // Returns a number in [0, 1).
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1p-53; }
  // Returns a nearly normal number of mean 0 and variance 1, never 0 itself, for coordinates of
  // random directions: a sum of twelve uniform numbers of 16 bits each, exact (Irwin and Hall).
  double NearlyNormal() {
    constexpr std::int64_t kTwiceMean = 12 * 0xffff;
    std::int64_t sum = 0;
    for (int word = 0; word < 3; ++word)
      for (std::uint64_t bits = Next(), part = 0; part < 4; ++part, bits >>= 16)
        sum += static_cast<std::int64_t>(bits & 0xffff);
    return static_cast<double>(2 * sum - kTwiceMean + 1) * 0x1p-17;
  }
  // Returns a uniform point of the unit ball of R^K: draws from the cube until a point is in the
  // ball, which takes 6.1 trials for K = 5.
  template <int K>
  void UniformInBall(double* x) {
    double norm2 = 0;
    do {
      norm2 = 0;
      for (int a = 0; a < K; ++a) {
        x[a] = 2 * Uniform() - 1;
        norm2 += x[a] * x[a];
      }
    } while (norm2 > 1);
  }

 private:
  std::uint64_t state_;
};

}  // namespace stellate::core
