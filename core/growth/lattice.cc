#include "core/growth/lattice.h"

#include <array>

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

}  // namespace stellate::core
