// What is said of a run that ended, and how far one is.

#include "core/run/ending.h"

#include <gtest/gtest.h>

#include "core/run/progress_meter.h"
#include "tests/core/support/in_process_run.h"
#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::EngineOnSphere;
using testing::Octahedron;
using testing::SphereSpec;
using testing::StepOnSphere;

bool Says(const std::string& text, const std::string& words) {
  return text.find(words) != std::string::npos;
}

TEST(Ending, TellsTheReachThatNeighboursShow) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.2), Octahedron());
  for (std::uint64_t round = 1; round < 6; ++round) ASSERT_TRUE(StepOnSphere(&engine, round));
  Certificate certificate;
  DescribeUnfinished<2>(engine, 0.2, &certificate);
  EXPECT_NEAR(certificate.estimated_reach, 1, 1e-6);
  EXPECT_NEAR(certificate.epsilon_over_reach, 0.2, 1e-6);
  EXPECT_GT(certificate.max_circumradius, 0.2);
  EXPECT_TRUE(certificate.warnings.empty());
  DescribeUnfinished<2>(engine, 0.9, &certificate);
  ASSERT_EQ(certificate.warnings.size(), 1u);
  EXPECT_TRUE(Says(certificate.warnings[0], "times the estimated reach"));
}

TEST(Ending, AsksWhetherItIsAManifoldAtAllWhereNoStarCloses) {
  const Engine<2> engine = EngineOnSphere(SphereSpec(0.2), Octahedron().leftCols(1));
  Certificate certificate;
  DescribeUnfinished<2>(engine, 0.2, &certificate);
  ASSERT_EQ(certificate.warnings.size(), 1u);
  EXPECT_TRUE(Says(certificate.warnings[0], "no star could be closed"));
}

TEST(Ending, CountsTheStarsThatBreakARule) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.2), Octahedron());
  const std::string left = WhatIsLeft<2>(engine, 7);
  EXPECT_TRUE(Says(left, "6 stars break rule R1 or R2, one of them that of vertex 0")) << left;
  EXPECT_TRUE(Says(left, "7 simplices are inconsistent")) << left;
  for (std::uint64_t round = 1; StepOnSphere(&engine, round);) ++round;
  EXPECT_EQ(WhatIsLeft<2>(engine, 0), "0 simplices are inconsistent; try a smaller epsilon");
}

TEST(Ending, WarnsOfSizesThatAreTooFine) {
  Specification spec = SphereSpec(0.5);
  spec.oracle.local_size = true;
  spec.criteria.size_rate = 0.5;
  Engine<2> engine(spec, Resolve(spec));
  AnsweredPoints answers = testing::OnSphere(Octahedron());
  answers.sizes = Eigen::VectorXd::Ones(6);
  answers.sizes[4] = 1e-6;
  for (Eigen::Index c = 0; c < 6; ++c) engine.Append(answers, c);
  Certificate certificate;
  // As often as it is asked.
  for (int i = 0; i < 2; ++i) {
    certificate.warnings.clear();
    WarnOfCompromises<2>(engine, 0.5, &certificate);
    ASSERT_EQ(certificate.warnings.size(), 1u);
    EXPECT_TRUE(Says(certificate.warnings[0], "at 1 vertices")) << certificate.warnings[0];
  }
}

TEST(Ending, TellsARunThatOnlyHadToBeCertified) {
  const auto sphere = testing::Make("sphere:2");
  Specification spec = testing::SpecificationFor(*sphere, 0.2);
  const std::uint64_t rounds = testing::Drive(spec, *sphere).report().counts.rounds;
  spec.limits.max_rounds = rounds - 1;
  const testing::DrivenRun refined = testing::Drive(spec, *sphere);
  EXPECT_EQ(refined.report().termination, Termination::kRoundBudget);
  EXPECT_FALSE(refined.report().certificate.certified);
  EXPECT_EQ(
      refined.report().certificate.verdict,
      "not certified: the run ended as ROUND_BUDGET when every rule held, before it was certified");
  spec.limits.max_rounds = 4;
  EXPECT_EQ(testing::Drive(spec, *sphere).report().certificate.verdict,
            "not certified: the run ended as ROUND_BUDGET before every rule held");
}

TEST(ProgressMeter, FollowsTheMesh) {
  const Specification spec = SphereSpec(0.2);
  Engine<2> empty(spec, Resolve(spec));
  Progress progress;
  Measure<2>(empty, false, 0, &progress);
  EXPECT_EQ(progress.phase, Phase::kSeeding);
  EXPECT_EQ(progress.fraction, 0);

  Engine<2> engine = EngineOnSphere(spec, Octahedron());
  Measure<2>(engine, false, 0, &progress);
  EXPECT_EQ(progress.phase, Phase::kRefining);
  EXPECT_EQ(progress.vertices, 6u);
  EXPECT_EQ(progress.bad_size, 6u);
  EXPECT_EQ(progress.unbounded_stars, 6u);  // too far from each other to see each other yet
  double before = progress.fraction;
  for (std::uint64_t round = 1; StepOnSphere(&engine, round); ++round) {
    Measure<2>(engine, false, 0, &progress);
    EXPECT_GE(progress.fraction, before);
    before = progress.fraction;
  }
  EXPECT_EQ(progress.simplices, engine.simplex_count());
  EXPECT_EQ(progress.unbounded_stars, 0u);
  EXPECT_EQ(progress.bad_size + progress.bad_radius_edge, 0u);
  EXPECT_EQ(progress.bad_sliver + progress.bad_inconsistent, 0u);
  Measure<2>(engine, true, 0, &progress);
  EXPECT_EQ(progress.phase, Phase::kCertifying);
  EXPECT_GE(progress.fraction, before);
  EXPECT_LT(progress.fraction, 1);
}

}  // namespace
}  // namespace stellate::core
