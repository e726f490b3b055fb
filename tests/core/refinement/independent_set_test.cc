#include "core/refinement/independent_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/base/random.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::FramedPoints;
using testing::Make;
using testing::RandomSample;

constexpr int kDimension = 2;
using Targets = std::vector<Target<kDimension>>;

class IndependentSetTest : public ::testing::Test {
 protected:
  IndependentSetTest() : sample_(RandomSample(*Make("torus:1:0.4@6"), 300, 1)) {
    AppendTo(&stars_, sample_);
    stars_.Commit();
  }

  Targets RandomTargets(std::uint64_t seed, double largest) const {
    Random random(seed);
    Targets targets(stars_.size());
    for (std::uint32_t p = 0; p < stars_.size(); ++p) {
      Target<kDimension>& t = targets[p];
      t.star = p;
      t.violation.rule = static_cast<Rule>(random.Next() % 4);
      const double angle = 6.3 * random.Uniform();
      // Few different radii, so that many targets tie.
      t.radius = largest * static_cast<double>(1 + random.Next() % 5) / 5;
      t.x[0] = t.radius * std::cos(angle);
      t.x[1] = t.radius * std::sin(angle);
    }
    return targets;
  }

  Targets Select(const Targets& targets, std::size_t most) const {
    Targets selected;
    for (const std::size_t i :
         SelectIndependent<kDimension>(6, CentresOf<kDimension>(stars_, targets), targets, most))
      selected.push_back(targets[i]);
    return selected;
  }

  // Whether a point at b's insertion point would lie in a's conflict ball.
  bool Conflict(const Target<kDimension>& a, const Target<kDimension>& b) const {
    double at[6], bt[6];
    stars_.sample().Lift(a.star, a.x, at);
    stars_.sample().Lift(b.star, b.x, bt);
    const double reach = a.violation.rule >= Rule::kShape ? 2 * a.radius : a.radius;
    return Distance(at, bt, 6) < reach;
  }

  static std::vector<std::uint32_t> StarsOf(const Targets& targets) {
    std::vector<std::uint32_t> stars;
    for (const auto& t : targets) stars.push_back(t.star);
    return stars;
  }

  FramedPoints sample_;
  Stars<kDimension> stars_{6, 0.3, {3, CentreRule::kTangentSpace}};
};

constexpr std::size_t kAll = static_cast<std::size_t>(-1);

// First by rule, then by radius, then by star: the order in which targets are taken.
bool Before(const Target<kDimension>& a, const Target<kDimension>& b) {
  if (a.violation.rule != b.violation.rule) return a.violation.rule < b.violation.rule;
  if (a.radius != b.radius) return a.radius > b.radius;
  return a.star < b.star;
}

TEST_F(IndependentSetTest, IsGreedyIndependentAndMaximal) {
  for (const double largest : {0.05, 0.2, 0.6}) {
    const Targets targets = RandomTargets(7, largest);
    Targets chosen = Select(targets, kAll);
    std::sort(chosen.begin(), chosen.end(), Before);
    ASSERT_FALSE(chosen.empty());
    for (std::size_t i = 0; i < chosen.size(); ++i)
      for (std::size_t j = i + 1; j < chosen.size(); ++j)
        EXPECT_FALSE(Conflict(chosen[i], chosen[j]));
    const std::vector<std::uint32_t> stars = StarsOf(chosen);
    for (const auto& t : targets) {
      if (std::find(stars.begin(), stars.end(), t.star) != stars.end()) continue;
      EXPECT_TRUE(std::any_of(chosen.begin(), chosen.end(),
                              [&](const auto& c) { return Before(c, t) && Conflict(c, t); }))
          << "star " << t.star << " was left out for nothing";
    }
  }
}

TEST_F(IndependentSetTest, TakesAllThatAreFarApart) {
  EXPECT_EQ(Select(RandomTargets(8, 1e-9), kAll).size(), stars_.size());
}

TEST_F(IndependentSetTest, DoesNotDependOnTheOrderOfTheTargets) {
  Targets targets = RandomTargets(9, 0.3);
  const auto chosen = StarsOf(Select(targets, kAll));
  Random random(3);
  for (int shuffle = 0; shuffle < 5; ++shuffle) {
    for (std::size_t i = targets.size(); i > 1; --i)
      std::swap(targets[i - 1], targets[random.Next() % i]);
    EXPECT_EQ(StarsOf(Select(targets, kAll)), chosen);
  }
}

TEST_F(IndependentSetTest, TheFirstOfItAreTheWorst) {
  const Targets targets = RandomTargets(10, 0.1);
  Targets all = Select(targets, kAll);
  ASSERT_GT(all.size(), 20u);
  Targets some = Select(targets, 20);
  std::sort(all.begin(), all.end(), Before);
  std::sort(some.begin(), some.end(), Before);
  all.resize(20);
  EXPECT_EQ(StarsOf(some), StarsOf(all));
}

TEST_F(IndependentSetTest, OfNothingIsNothing) { EXPECT_TRUE(Select({}, kAll).empty()); }

}  // namespace
}  // namespace stellate::core
