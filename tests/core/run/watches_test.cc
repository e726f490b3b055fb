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
int RoundsUntilStalled(StallWatch& watch, const Left& left, bool is_last = false) {
  int rounds = 0;
  while (!watch.HasStalled(left(rounds), false, is_last) && rounds < 10'000) ++rounds;
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

// As near a face that bends more than the finest size: 2 violations became 324 in 300 rounds.
TEST(StallWatch, GivesUpSoonerWhereThereAreMoreAndMore) {
  const auto more = [](int round) { return static_cast<std::uint64_t>(2 + round); };
  const auto same = [](int) { return std::uint64_t{2}; };
  StallWatch growing(3), constant(3), last(3);
  const int rounds = RoundsUntilStalled(growing, more),
            patience = RoundsUntilStalled(constant, same);
  EXPECT_GT(rounds, 50);
  EXPECT_LT(2 * rounds, patience);
  // Nothing comes after the last stage.
  EXPECT_EQ(RoundsUntilStalled(last, more, true), patience);
}

// Where sizes follow what is seen, each patch of small simplices ends, and the next one begins.
TEST(StallWatch, IsPatientWhileWhatGrowsFallsAgain) {
  const auto waves = [](int round) { return static_cast<std::uint64_t>(50 + 10 * (round % 15)); };
  const auto same = [](int) { return std::uint64_t{50}; };
  StallWatch falling(1), constant(1), slow(1);
  const int patience = RoundsUntilStalled(constant, same);
  EXPECT_EQ(RoundsUntilStalled(falling, waves), patience);
  // Less than twice as many in all that time may be the same places, better known.
  const auto few = [](int round) { return static_cast<std::uint64_t>(100 + round / 2); };
  EXPECT_EQ(RoundsUntilStalled(slow, few), patience);
}

TEST(StallWatch, CountsAnewWhenMoreRulesAreJudged) {
  StallWatch watch(1);
  for (int round = 0; round < 100; ++round) EXPECT_FALSE(watch.HasStalled(50, false));
  for (int round = 0; round < 100; ++round) EXPECT_FALSE(watch.HasStalled(5000, true));
}

}  // namespace
}  // namespace stellate::core
