#include "core/index/runs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/base/random.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// A walk that jumps now and then.
std::vector<double> Walk(int d, std::size_t count) {
  Random random(5, static_cast<std::uint64_t>(d));
  std::vector<double> x(count * static_cast<std::size_t>(d)), at(static_cast<std::size_t>(d));
  for (std::size_t i = 0; i < count; ++i) {
    const double step = random.Uniform() < 0.05 ? 10 : 0.1;
    for (double& c : at) c += step * random.NearlyNormal();
    std::copy(at.begin(), at.end(), x.begin() + static_cast<std::ptrdiff_t>(i * at.size()));
  }
  return x;
}

TEST(Runs, HoldEveryPointOnceInItsBall) {
  constexpr std::size_t kCount = 1000;
  constexpr double kReach = 0.5;
  for (const int d : {1, 3, 9}) {
    const std::vector<double> x = Walk(d, kCount);
    const auto at = [&](std::size_t i) { return x.data() + i * static_cast<std::size_t>(d); };
    const Runs runs(x, d, kReach);
    std::size_t next = 0;
    for (std::size_t run = 0; run < runs.count(); ++run) {
      ASSERT_EQ(runs.begin(run), next);
      ASSERT_GT(runs.end(run), next);
      for (std::size_t i = next; i < runs.end(run); ++i) {
        EXPECT_LE(Distance(at(next), at(i), d), kReach);
        EXPECT_LE(Distance(runs.centre(run), at(i), d), runs.radius(run));
      }
      next = runs.end(run);
    }
    EXPECT_EQ(next, kCount);
    EXPECT_GT(runs.count(), kCount / 32);  // it jumps
    EXPECT_LT(runs.count(), kCount / 2);   // and yet mostly holds together
  }
}

// Long stretches are cut at once: as if one run had been cut after the other.
TEST(Runs, DoNotDependOnHowManyAreCutAtOnce) {
  constexpr std::size_t kCount = 30000;
  for (const double reach : {0.02, 0.5, 1e9}) {
    const std::vector<double> x = Walk(2, kCount);
    const Runs runs(x, 2, reach);
    std::size_t run = 0;
    for (std::size_t begin = 0, end; begin < kCount; begin = end, ++run) {
      for (end = begin + 1; end < kCount && end < begin + 32; ++end)
        if (Distance(x.data() + 2 * begin, x.data() + 2 * end, 2) > reach) break;
      ASSERT_LT(run, runs.count());
      ASSERT_EQ(runs.begin(run), begin);
      ASSERT_EQ(runs.end(run), end);
    }
    EXPECT_EQ(run, runs.count());
  }
}

TEST(Runs, GoByTheShareOfTheirFirst) {
  constexpr std::size_t kCount = 300;
  std::vector<double> x(kCount), shares(kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    x[i] = 0.1 * static_cast<double>(i);
    shares[i] = i < kCount / 2 ? 1 : 0.25;
  }
  const Runs runs(x, 1, 1.05, shares);
  for (std::size_t run = 0; run + 1 < runs.count(); ++run)
    EXPECT_EQ(runs.end(run) - runs.begin(run), runs.begin(run) < kCount / 2 ? 11u : 3u);
}

TEST(Runs, OfNothingAreNone) {
  const Runs runs({}, 3, 1);
  EXPECT_EQ(runs.count(), 0u);
  EXPECT_TRUE(runs.radii().empty());
}

}  // namespace
}  // namespace stellate::core
