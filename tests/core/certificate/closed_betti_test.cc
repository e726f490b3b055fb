#include "core/certificate/complex/closed_betti.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace stellate::core {
namespace {

using Numbers = std::vector<std::int64_t>;

// Adds the boundary of a (k+1)-simplex.
void AddSphere(std::uint32_t k, std::uint32_t first, std::vector<std::uint32_t>* ids) {
  for (std::uint32_t out = 0; out < k + 2; ++out)
    for (std::uint32_t v = 0; v < k + 2; ++v)
      if (v != out) ids->push_back(first + v);
}

TEST(ClosedBettiNumbers, OfSpheresAndSeveral) {
  for (const int k : {1, 2, 3}) {
    std::vector<std::uint32_t> ids;
    for (std::int64_t components = 1; components <= 3; ++components) {
      // With a vertex between the spheres that no simplex has.
      AddSphere(static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(7 * components), &ids);
      const std::int64_t euler = k == 2 ? 2 * components : 0;
      Numbers expected(static_cast<std::size_t>(k) + 1, 0);
      expected.front() = expected.back() = components;
      EXPECT_EQ(ClosedBettiNumbers({k, 40, &ids}, components, euler), expected);
    }
  }
}

// The product of a circle of n edges and the boundary of a tetrahedron, each prism over a triangle
// cut along its ascending vertices: S^1 x S^2.
TEST(ClosedBettiNumbers, OfACircleTimesASphere) {
  constexpr std::uint32_t kEdges = 5;
  std::vector<std::uint32_t> sphere, ids;
  AddSphere(2, 0, &sphere);
  for (std::uint32_t e = 0; e < kEdges; ++e) {
    const std::uint32_t low = std::min(4 * e, 4 * ((e + 1) % kEdges));
    const std::uint32_t high = std::max(4 * e, 4 * ((e + 1) % kEdges));
    for (std::size_t t = 0; t < sphere.size(); t += 3)
      for (std::size_t turn = 0; turn < 3; ++turn) {
        for (std::size_t i = 0; i <= turn; ++i) ids.push_back(low + sphere[t + i]);
        for (std::size_t i = turn; i < 3; ++i) ids.push_back(high + sphere[t + i]);
      }
  }
  EXPECT_EQ(ClosedBettiNumbers({3, 4 * kEdges, &ids}, 1, 0), (Numbers{1, 1, 1, 1}));
}

TEST(ClosedBettiNumbers, AreNotComputedInHigherDimensions) {
  std::vector<std::uint32_t> ids;
  AddSphere(4, 0, &ids);
  EXPECT_EQ(ClosedBettiNumbers({4, 6, &ids}, 1, 2), Numbers());
}

}  // namespace
}  // namespace stellate::core
