#include "core/run/watches.h"

#include <gtest/gtest.h>

#include <vector>

namespace stellate::core {
namespace {

BoundingBox UnitBox() { return {Eigen::Vector2d(0, 0), Eigen::Vector2d(1, 1)}; }

TEST(BoxWatch, WarnsOfWhatLiesALittleOutside) {
  BoxWatch watch(UnitBox(), 0.1);
  const std::vector<double> points = {0.5, 0.5, 1.05, 0.5, 0.5, -0.3};
  watch.Look(points.data(), 2);
  Certificate certificate;
  watch.Warn(&certificate);
  EXPECT_TRUE(certificate.warnings.empty());  // within epsilon
  watch.Look(points.data(), 3);
  watch.Warn(&certificate);
  ASSERT_EQ(certificate.warnings.size(), 1u);
  EXPECT_NE(certificate.warnings[0].find("1 of 3 vertices"), std::string::npos);
  EXPECT_FALSE(watch.has_left());
}

TEST(BoxWatch, EndsWhatGoesOnForABoxOutside) {
  BoxWatch watch(UnitBox(), 0.1);
  const std::vector<double> points = {0.5, 0.5, 3, 0.5};
  watch.Look(points.data(), 2);
  EXPECT_TRUE(watch.has_left());
  EXPECT_NE(watch.WhyStopped().find("goes on for 2 beyond it"), std::string::npos)
      << watch.WhyStopped();
}

TEST(BoxWatch, HasNothingToSayWithoutABox) {
  BoxWatch watch(std::nullopt, 0.1);
  const std::vector<double> points = {1e9, 1e9};
  watch.Look(points.data(), 1);
  EXPECT_FALSE(watch.has_left());
  Certificate certificate;
  watch.Warn(&certificate);
  EXPECT_TRUE(certificate.warnings.empty());
}

// Rounds until it gives up, `left` violations in each.
template <typename Left>
int RoundsUntilStalled(StallWatch& watch, const Left& left) {
  int rounds = 0;
  while (!watch.HasStalled(left(rounds), false) && rounds < 10'000) ++rounds;
  return rounds;
}

TEST(StallWatch, GivesUpWhereNothingGetsFewer) {
  StallWatch one(1), three(3);
  const auto same = [](int) { return std::uint64_t{50}; };
  const int rounds = RoundsUntilStalled(one, same);
  EXPECT_GT(rounds, 50);
  EXPECT_GT(RoundsUntilStalled(three, same), 2 * rounds);
}

TEST(StallWatch, IsPatientWhileThereAreFewerOrTheFrontMoves) {
  StallWatch fewer(1);
  EXPECT_FALSE(fewer.HasStalled(1'000'000, false));
  std::uint64_t left = 1'000'000;
  for (int round = 0; round < 1000; ++round) {
    if (round % 90 == 0) left = left * 2 / 3;
    EXPECT_FALSE(fewer.HasStalled(left, false)) << round;
  }
  StallWatch front(1);
  for (int round = 0; round < 1000; ++round) {
    front.NoteFrontMoved();
    EXPECT_FALSE(front.HasStalled(50, false));
  }
}

TEST(StallWatch, CountsAnewWhenMoreRulesAreJudged) {
  StallWatch watch(1);
  for (int round = 0; round < 100; ++round) EXPECT_FALSE(watch.HasStalled(50, false));
  for (int round = 0; round < 100; ++round) EXPECT_FALSE(watch.HasStalled(5000, true));
}

}  // namespace
}  // namespace stellate::core
