#include "core/sampling/lattice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/base/random.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

class Lattice : public ::testing::TestWithParam<int> {};

TEST_P(Lattice, HasItsVectorsInPairsAndNoneShorterThanOne) {
  const int k = GetParam();
  const std::vector<double> v = LatticeVectors(k);
  const std::size_t count = v.size() / static_cast<std::size_t>(k);
  ASSERT_EQ(count, (std::size_t{2} << k) - 2);
  double longest = 0, shortest = INFINITY;
  for (std::size_t i = 0; i < count; ++i) {
    const double* a = v.data() + i * static_cast<std::size_t>(k);
    const double length = std::sqrt(Dot(a, a, k));
    longest = std::max(longest, length);
    shortest = std::min(shortest, length);
    int opposites = 0;
    for (std::size_t j = 0; j < count; ++j) {
      double off = 0;
      for (int c = 0; c < k; ++c)
        off += std::abs(a[c] + v[j * static_cast<std::size_t>(k) + static_cast<std::size_t>(c)]);
      opposites += off < 1e-12;
    }
    EXPECT_EQ(opposites, 1);
  }
  EXPECT_NEAR(shortest, 1, 1e-12);
  EXPECT_NEAR(longest, LongestLatticeVector(k), 1e-12);
}

// Two ways to a point, by vectors that add up to the same, come to one name; and there are no two
// neighbours of one.
TEST_P(Lattice, NamesAPointTheSameOnEveryWayThere) {
  const int k = GetParam();
  const LatticeNames names(k);
  const std::vector<double> v = LatticeVectors(k);
  const std::size_t stride = static_cast<std::size_t>(k), count = v.size() / stride;
  std::vector<std::uint64_t> neighbours;
  for (std::size_t i = 0; i < count; ++i) {
    neighbours.push_back(names.Neighbour(names.origin(), i));
    for (std::size_t j = 0; j < count; ++j) {
      const std::uint64_t there = names.Neighbour(neighbours.back(), j);
      EXPECT_EQ(there, names.Neighbour(names.Neighbour(names.origin(), j), i));
      double off = 0;
      for (std::size_t c = 0; c < stride; ++c)
        off += std::abs(v[i * stride + c] + v[j * stride + c]);
      EXPECT_EQ(there == names.origin(), off < 1e-12);
    }
  }
  std::sort(neighbours.begin(), neighbours.end());
  EXPECT_EQ(std::adjacent_find(neighbours.begin(), neighbours.end()), neighbours.end());
}

// The sums of its vectors lie no farther than the covering radius from any point, and some points
// have all but that.
TEST_P(Lattice, CoversWithTheRadiusThatItsSpacingIsFor) {
  const int k = GetParam();
  const std::vector<double> v = LatticeVectors(k);
  const std::size_t stride = static_cast<std::size_t>(k);
  Random random(5);
  double most = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    // Nearest lattice point by descent over the Voronoi-relevant vectors, which finds it.
    std::vector<double> x(stride);
    for (double& c : x) c = 3 * random.Uniform();
    for (bool moved = true; moved;) {
      moved = false;
      for (std::size_t i = 0; i < v.size(); i += stride) {
        double along = 0, length2 = 0;
        for (std::size_t c = 0; c < stride; ++c) {
          along += x[c] * v[i + c];
          length2 += v[i + c] * v[i + c];
        }
        if (along <= length2 / 2 * (1 + 1e-12)) continue;
        for (std::size_t c = 0; c < stride; ++c) x[c] -= v[i + c];
        moved = true;
      }
    }
    most = std::max(most, std::sqrt(Dot(x.data(), x.data(), k)));
  }
  const double covering = 1 / LatticeSpacing(k);
  EXPECT_LE(most, covering * (1 + 1e-9));
  EXPECT_GE(most, (k <= 3 ? 0.95 : 0.85) * covering);
}

INSTANTIATE_TEST_SUITE_P(Dimensions, Lattice, ::testing::Values(1, 2, 3, 4, 5));

}  // namespace
}  // namespace stellate::core
