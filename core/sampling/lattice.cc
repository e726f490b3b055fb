#include "core/sampling/lattice.h"

#include <array>
#include <bit>

#include "core/specification.h"

namespace stellate::core {

// The sums of the proper subsets of k + 1 unit vectors at equal angles, which are those from the
// centre of a regular simplex to its corners.
std::vector<double> LatticeVectors(int k) {
  std::array<std::array<double, kMaxDimension>, kMaxDimension + 1> corner{};
  for (int a = 0; a < k; ++a) {
    double rest = 1;
    for (int b = 0; b < a; ++b) rest -= corner[a][b] * corner[a][b];
    corner[a][a] = std::sqrt(rest);
    for (int j = a + 1; j <= k; ++j) {
      double product = -1.0 / k;
      for (int b = 0; b < a; ++b) product -= corner[a][b] * corner[j][b];
      corner[j][a] = product / corner[a][a];
    }
  }
  std::vector<double> vectors;
  for (unsigned set = 1; set + 1 < (1u << (k + 1)); ++set)
    for (int a = 0; a < k; ++a) {
      double sum = 0;
      for (int i = 0; i <= k; ++i)
        if (set >> i & 1) sum += corner[i][a];
      vectors.push_back(sum);
    }
  return vectors;
}

// The vectors to the first k corners of that simplex are a basis, and that to the last is less
// their sum.
LatticeNames::LatticeNames(int k) : coordinates_(static_cast<std::size_t>(k)) {
  for (int bit = 0; bit < 64; ++bit) coordinates_[bit % k] |= std::uint64_t{1} << bit;
  for (const std::uint64_t bits : coordinates_) origin_ |= std::bit_floor(bits);
  for (unsigned set = 1; set + 1 < (1u << (k + 1)); ++set) {
    std::uint64_t step = 0;
    const bool has_last = set >> k & 1;
    for (int a = 0; a < k; ++a) {
      const bool has = set >> a & 1;
      if (has && !has_last) step |= std::uint64_t{1} << a;
      if (!has && has_last) step |= coordinates_[a];
    }
    steps_.push_back(step);
  }
}

}  // namespace stellate::core
