#include "core/base/random.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace stellate::core {
namespace {

TEST(Mix64, GivesDifferentWordsForDifferentWords) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t i = 0; i < 20000; ++i) seen.insert(Mix64(i));
  for (int bit = 16; bit < 64; ++bit) seen.insert(Mix64(std::uint64_t{1} << bit));
  EXPECT_EQ(seen.size(), 20048u);
}

// Each bit of the input should flip about half of the output's.
TEST(Mix64, Scatters) {
  for (int bit = 0; bit < 64; ++bit) {
    int flipped = 0;
    for (std::uint64_t i = 0; i < 200; ++i)
      flipped += __builtin_popcountll(Mix64(i) ^ Mix64(i ^ (std::uint64_t{1} << bit)));
    EXPECT_NEAR(flipped / 200.0, 32, 2) << "bit " << bit;
  }
}

TEST(Random, IsDeterminedBySeedAndKey) {
  Random a(7, 3), b(7, 3), other_key(7, 4), other_seed(8, 3);
  int same_key = 0, same_seed = 0;
  for (int i = 0; i < 100; ++i) {
    const std::uint64_t x = a.Next();
    EXPECT_EQ(x, b.Next());
    same_key += x == other_key.Next();
    same_seed += x == other_seed.Next();
  }
  EXPECT_EQ(same_key, 0);
  EXPECT_EQ(same_seed, 0);
}

TEST(Random, IsUniformOnTheUnitInterval) {
  Random random(1);
  constexpr int kDraws = 100'000, kBins = 20;
  std::vector<int> bins(kBins);
  for (int i = 0; i < kDraws; ++i) {
    const double u = random.Uniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    ++bins[static_cast<std::size_t>(u * kBins)];
  }
  // Chi squared with 19 degrees of freedom exceeds 45 once in a thousand.
  double chi2 = 0;
  for (const int b : bins) chi2 += (b - 5000.0) * (b - 5000.0) / 5000.0;
  EXPECT_LT(chi2, 45);
}

TEST(Random, HasTheMomentsOfTheNormalDistribution) {
  Random random(2);
  constexpr int kDraws = 100'000;
  double moments[5] = {};
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Normal();
    for (double& m : moments) m += std::pow(x, &m - moments) / kDraws;
  }
  EXPECT_NEAR(moments[1], 0, 0.02);
  EXPECT_NEAR(moments[2], 1, 0.03);
  EXPECT_NEAR(moments[3], 0, 0.06);
  EXPECT_NEAR(moments[4], 3, 0.2);
}

// Streams with neighbouring keys must not resemble each other: stars draw from them side by side.
TEST(Random, StreamsOfNeighbouringKeysAreUncorrelated) {
  double sum = 0;
  constexpr int kKeys = 20'000;
  for (std::uint64_t key = 0; key < kKeys; ++key)
    sum += (Random(5, key).Uniform() - 0.5) * (Random(5, key + 1).Uniform() - 0.5);
  EXPECT_NEAR(12 * sum / kKeys, 0, 0.03);
}

}  // namespace
}  // namespace stellate::core
