// What is said of a run that ended.

#include "core/run/ending.h"

#include <gtest/gtest.h>

#include <utility>

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
  DescribeUnfinished<2>(engine, 0.2, true, &certificate);
  EXPECT_NEAR(certificate.estimated_reach, 1, 1e-6);
  EXPECT_NEAR(certificate.epsilon_over_reach, 0.2, 1e-6);
  EXPECT_GT(certificate.max_circumradius, 0.2);
  EXPECT_TRUE(certificate.warnings.empty());
  DescribeUnfinished<2>(engine, 0.9, false, &certificate);
  EXPECT_TRUE(certificate.warnings.empty()) << "no epsilon will do";
  DescribeUnfinished<2>(engine, 0.9, true, &certificate);
  ASSERT_EQ(certificate.warnings.size(), 1u);
  EXPECT_TRUE(Says(certificate.warnings[0], "times the estimated reach"));
  EXPECT_TRUE(Says(certificate.warnings[0], "which was seen near vertex ")) << "there is where";
}

// A cusp and two sheets that touch show as little reach as the mesh is fine there, and an epsilon
// that is a share of it would find less again.
TEST(Ending, DoesNotSwearThatASmallerEpsilonHelpsWhereThereMayBeNoReach) {
  Engine<2> engine = EngineOnSphere(SphereSpec(0.2), Octahedron());
  for (std::uint64_t round = 1; round < 6; ++round) ASSERT_TRUE(StepOnSphere(&engine, round));
  for (const auto& [epsilon, doubts] : {std::pair{10.0, false}, {30.0, true}}) {
    Certificate certificate;
    DescribeUnfinished<2>(engine, epsilon, true, &certificate);
    ASSERT_EQ(certificate.warnings.size(), 1u);
    EXPECT_TRUE(Says(certificate.warnings[0], "take epsilon at most"));
    EXPECT_EQ(Says(certificate.warnings[0], "no epsilon will do: the manifold has a cusp"), doubts);
  }
}

TEST(Ending, AsksWhetherItIsAManifoldAtAllWhereNoStarCloses) {
  const Engine<2> engine = EngineOnSphere(SphereSpec(0.2), Octahedron().leftCols(1));
  Certificate certificate;
  DescribeUnfinished<2>(engine, 0.2, true, &certificate);
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
      "not certified: the run ended as ROUND_BUDGET when every rule held, before it was certified: "
      "allow more rounds (max_rounds)");
  spec.limits.max_rounds = 4;
  EXPECT_EQ(
      testing::Drive(spec, *sphere).report().certificate.verdict,
      "not certified: the run ended as ROUND_BUDGET before every rule held: allow more rounds "
      "(max_rounds)");
}

}  // namespace
}  // namespace stellate::core
