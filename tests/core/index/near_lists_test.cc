#include "core/index/near_lists.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/random.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

TEST(NearLists, HoldWhatIsNearerAndNothingElse) {
  for (const int d : {1, 3, 6}) {
    for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{400}}) {
      Random random(static_cast<std::uint64_t>(d), count);
      std::vector<double> x(count * static_cast<std::size_t>(d));
      for (double& c : x) c = random.Uniform();
      // Some in the same place.
      for (std::size_t j = 0; count > 10 && j < 5 * static_cast<std::size_t>(d); ++j) x[j] = 0.5;
      const double radius = 0.2 * d;
      const NearLists near(x, d, radius);
      ASSERT_EQ(near.size(), count);
      for (std::uint32_t i = 0; i < count; ++i) {
        std::vector<std::uint32_t> expected;
        for (std::uint32_t j = 0; j < count; ++j)
          if (i != j && Distance(x.data() + i * static_cast<std::size_t>(d),
                                 x.data() + j * static_cast<std::size_t>(d), d) < radius)
            expected.push_back(j);
        const auto found = near.Of(i);
        EXPECT_EQ(std::vector<std::uint32_t>(found.begin(), found.end()), expected);
      }
    }
  }
}

TEST(NearLists, GoByTheSmallerShareOfTwo) {
  constexpr int kD = 2;
  constexpr std::size_t kCount = 500;
  constexpr double kRadius = 0.3;
  Random random(7, 0);
  std::vector<double> x(kCount * kD), shares(kCount);
  for (double& c : x) c = random.Uniform();
  for (double& share : shares) share = 0.05 + 0.95 * random.Uniform();
  const NearLists near(x, kD, kRadius, shares);
  std::size_t found = 0;
  for (std::uint32_t i = 0; i < kCount; ++i) {
    std::vector<std::uint32_t> expected;
    for (std::uint32_t j = 0; j < kCount; ++j)
      if (i != j && Distance(x.data() + i * kD, x.data() + j * kD, kD) <
                        kRadius * std::min(shares[i], shares[j]))
        expected.push_back(j);
    EXPECT_EQ(std::vector<std::uint32_t>(near.Of(i).begin(), near.Of(i).end()), expected);
    found += expected.size();
  }
  EXPECT_GT(found, kCount);
}

}  // namespace
}  // namespace stellate::core
