#include "core/base/random.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "core/base/power.h"

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

constexpr int kMany = 200'000;

TEST(Random, NearlyNormalHasTheMomentsOfTheNormal) {
  Random random(1);
  double first = 0, second = 0, fourth = 0;
  for (int i = 0; i < kMany; ++i) {
    const double x = random.NearlyNormal();
    ASSERT_NE(x, 0);
    first += x / kMany;
    second += x * x / kMany;
    fourth += x * x * x * x / kMany;
  }
  EXPECT_NEAR(first, 0, 0.01);
  EXPECT_NEAR(second, 1, 0.02);
  EXPECT_NEAR(fourth, 3 - 0.1, 0.1) << "a sum of twelve has 0.1 less than the normal";
}

// No axis or diagonal is preferred by more than a per cent or two.
TEST(Random, DirectionsHaveNoPreference) {
  for (const int d : {2, 3, 10}) {
    Random random(2);
    Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(d, d);
    double along_axis = 0, along_diagonal = 0;
    const Eigen::VectorXd diagonal = Eigen::VectorXd::Ones(d).normalized();
    for (int i = 0; i < kMany; ++i) {
      Eigen::VectorXd x(d);
      for (double& a : x) a = random.NearlyNormal();
      x.normalize();
      spread += d * x * x.transpose() / kMany;
      along_axis += Power(x[0], 4);
      along_diagonal += Power(x.dot(diagonal), 4);
    }
    EXPECT_LT((spread - Eigen::MatrixXd::Identity(d, d)).cwiseAbs().maxCoeff(), 0.02) << d;
    EXPECT_NEAR(along_axis / along_diagonal, 1, 0.04) << d;
  }
}

template <int K>
void ExpectUniformInBall() {
  Random random(3);
  // Of radius and of each half: by volume.
  std::vector<int> shells(10, 0);
  int above = 0;
  for (int i = 0; i < kMany; ++i) {
    double x[K], norm2 = 0;
    random.UniformInBall<K>(x);
    for (const double a : x) norm2 += a * a;
    ASSERT_LE(norm2, 1);
    ++shells[static_cast<std::size_t>(std::min(9.0, std::floor(10 * Power(std::sqrt(norm2), K))))];
    above += x[K - 1] > 0;
  }
  for (const int count : shells) EXPECT_NEAR(count, kMany / 10.0, 0.03 * kMany / 10) << K;
  EXPECT_NEAR(above, kMany / 2.0, 0.01 * kMany) << K;
}

TEST(Random, PointsOfTheBallAreUniform) {
  ExpectUniformInBall<1>();
  ExpectUniformInBall<2>();
  ExpectUniformInBall<3>();
  ExpectUniformInBall<4>();
  ExpectUniformInBall<5>();
}

// To the last bit, so that no compiler or processor draws otherwise unseen.
TEST(Random, DrawsWhatItDrewEverywhere) {
  EXPECT_EQ(Random(17, 4).Next(), 0xd8f898e767653033u);
  Random random(17, 4);
  double x[3];
  random.UniformInBall<3>(x);
  EXPECT_EQ(x[0], 0x1.63e2639d9d94cp-1);
  EXPECT_EQ(x[1], 0x1.42022cc480562p-1);
  EXPECT_EQ(x[2], -0x1.09a413b883790p-2);
  EXPECT_EQ(random.NearlyNormal(), -0x1.35df000000000p-1);
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
