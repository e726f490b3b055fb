#include "core/speculation/speculation.h"

#include <gtest/gtest.h>

#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::EngineOnSphere;
using testing::SphereSpec;
using testing::StepOnSphere;

// Many seeds, as a speculative run begins with: their graphs are a good estimate of the sphere.
Eigen::MatrixXd ManySeeds() {
  Eigen::MatrixXd seeds(3, 300);
  Random random(4);
  for (Eigen::Index i = 0; i < seeds.size(); ++i) seeds.data()[i] = random.NearlyNormal();
  return seeds;
}

TEST(Speculation, WantsPointsNearMAndLeavesTheEngineAsItWas) {
  const Engine<2> engine = EngineOnSphere(SphereSpec(0.1), ManySeeds());
  const std::vector<double> before = engine.stars().sample().points();
  Engine<2> copy(engine);
  std::vector<Target<2>> targets = copy.Select(*copy.Plan());
  const std::size_t all = targets.size();
  const PlannedPoints planned = RunSpeculatively<2>(copy, 1, &targets);
  EXPECT_EQ(copy.stars().sample().points(), before);
  ASSERT_GT(planned.size(), 100);
  EXPECT_EQ(planned.tangents.cols(), planned.size());
  EXPECT_EQ(planned.spacing.size(), planned.size());
  EXPECT_EQ(std::ssize(planned.rules), planned.size());
  EXPECT_LT(targets.size(), all / 2);  // most it mends itself
  for (Eigen::Index i = 0; i < planned.size(); ++i) {
    EXPECT_NEAR(planned.points.col(i).norm(), 1, 0.01);
    EXPECT_GT(planned.spacing[i], 0);
    EXPECT_LT(planned.spacing[i], 0.4);
  }
}

TEST(Speculation, SavesRounds) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.1), ManySeeds()), plain(engine);
  std::uint64_t rounds = 0, plain_rounds = 0;
  while (StepOnSphere(&plain, plain_rounds)) ++plain_rounds;
  for (auto targets = engine.Plan(); targets && !targets->empty(); targets = engine.Plan()) {
    *targets = engine.Select(*targets);
    PlannedPoints planned = RunSpeculatively<2>(engine, rounds, &*targets);
    CandidateSet<2> candidates = engine.Draw(*targets, rounds++);
    candidates.planned = std::move(planned);
    engine.Insert(candidates, testing::OnSphere(candidates));
    engine.Commit();
    ASSERT_LT(rounds, 100u);
  }
  EXPECT_TRUE(engine.AllRulesHold());
  EXPECT_LT(2 * rounds, plain_rounds);
}

}  // namespace
}  // namespace stellate::core
