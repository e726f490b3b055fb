#include "core/refinement/protecting_balls.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/refinement/criteria.h"

namespace stellate::core {
namespace {

// The rule by itself, along one edge: which lengths are split for balls of those shares. How many
// there are in the end; 0: more than a thousand.
std::size_t SplitAlong(std::vector<double> lengths, double share, double overlap) {
  while (lengths.size() < 1000) {
    std::vector<double> radii = {share * lengths.front()};
    for (std::size_t i = 1; i < lengths.size(); ++i)
      radii.push_back(share * std::min(lengths[i - 1], lengths[i]));
    radii.push_back(share * lengths.back());
    std::vector<double> split;
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      const bool is_gap = radii[i] + radii[i + 1] < overlap * lengths[i] * (1 - 1e-12);
      split.insert(split.end(), is_gap ? 2 : 1, is_gap ? lengths[i] / 2 : lengths[i]);
    }
    if (split.size() == lengths.size()) return lengths.size();
    lengths = std::move(split);
  }
  return 0;
}

// How many of a hundred edges, whose lengths are those of curved ones, are split to an end.
int CountEnds(double share, double overlap) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> within_two(0.5, 1);
  int ends = 0;
  for (int i = 0; i < 100; ++i) {
    std::vector<double> lengths(12);
    for (double& length : lengths) length = within_two(random);
    ends += SplitAlong(lengths, share, overlap) > 0;
  }
  return ends;
}

TEST(BallShares, EndIfAndOnlyIfTheirLawHolds) {
  const double most = 1 + 1 / std::numbers::sqrt2;
  EXPECT_LE(kBallOverlap / kBallShare, most);
  EXPECT_EQ(CountEnds(kBallShare, kBallOverlap), 100);
  for (const double share : {0.75, 0.95}) {
    EXPECT_EQ(CountEnds(share, share * (most - 1e-3)), 100);
    EXPECT_LT(CountEnds(share, share * (most + 0.02)), 90) << "or else the law asks for too much";
  }
}

TEST(BallShares, MakeNoEdgeShorterThanTheShortest) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> octaves(-6, 0);
  for (int i = 0; i < 100; ++i) {
    std::vector<double> lengths(12);
    for (double& length : lengths) length = std::exp2(octaves(random));
    const std::size_t count = SplitAlong(lengths, kBallShare, kBallOverlap);
    ASSERT_GT(count, 0u);
    EXPECT_LE(count, 20u * 7 * lengths.size()) << "MostSplits";
  }
}

// The edge of a wedge of 30 degrees, with points at these heights.
Stars<3> WedgeEdge(const std::vector<double>& heights) {
  constexpr double kFrame[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double conormals[6] = {-0.5, std::numbers::sqrt3 / 2, 0, 0, -1, 0};
  Stars<3> stars(3, 1, {10, CentreRule::kTangentSpace});
  for (const double height : heights) {
    const double point[3] = {0, 0, height};
    stars.Add(point, kFrame, Stars<3>::kNone, WallSet{3}, conormals);
  }
  stars.Commit();
  return stars;
}

SizeField<3> SizesOf(double epsilon) {
  Specification spec;
  spec.dimension = spec.ambient_dimension = 3;
  spec.epsilon = epsilon;
  spec.walls = 2;
  return SizeField<3>(Resolve(spec));
}

TEST(PlanProtectingBalls, TellsWhichEdgesAreTooLongForTheirBalls) {
  const Stars<3> stars = WedgeEdge({0, 1, 1.2, 1.4, 1.6});
  ASSERT_TRUE(NeedsProtection<3>(stars));
  const ProtectingBalls<3> balls = PlanProtectingBalls<3>(stars, SizesOf(1));
  EXPECT_NEAR(std::sqrt(balls.radii2[2]), kBallShare * 0.2, 1e-12);
  ASSERT_EQ(balls.gaps.size(), 1u) << "beside 1 and 0.2 alone";
  EXPECT_EQ(balls.edges, 4u);
  EXPECT_NEAR(balls.longest, 1, 1e-12);
  EXPECT_NEAR(balls.least_clearance, 0.2, 1e-12);
  EXPECT_EQ(MostSplits<3>(balls), 20u * 4 * 4) << "from 0.2 to 1 there are four octaves";
}

// A later pass: what was inserted since lies just outside of the balls, and would shrink them.
TEST(PlanProtectingBalls, LeavesTheBallsThatThereAre) {
  Stars<3> stars = WedgeEdge({0, 1, 2, 3});
  ProtectingBalls<3> first = PlanProtectingBalls<3>(stars, SizesOf(2));
  EXPECT_TRUE(first.gaps.empty());
  first.radii2[3] = 0;
  stars.SetProtectingBalls(first.radii2);
  constexpr double kFrame[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  constexpr double kBelow[3] = {0, -1, 0};
  const double radius = std::sqrt(first.radii2[1]);
  const double beside[3] = {1.0001 * radius, 0, 1};
  stars.Add(beside, kFrame, Stars<3>::kNone, WallSet{2}, kBelow);
  stars.Commit();
  const ProtectingBalls<3> second = PlanProtectingBalls<3>(stars, SizesOf(2));
  for (std::uint32_t p = 0; p < 3; ++p) EXPECT_EQ(second.radii2[p], first.radii2[p]);
  EXPECT_GT(second.radii2[3], 0);
  EXPECT_EQ(second.radii2[4], 0);
}

}  // namespace
}  // namespace stellate::core
