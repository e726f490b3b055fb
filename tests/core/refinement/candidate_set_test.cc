#include "core/refinement/candidate_set.h"

#include <gtest/gtest.h>

#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::FlatSample;

constexpr double kRadius = 0.2;

// A flat sample, a target of R1 for star 3 and one of R3 for star 5.
class CandidateSetTest : public ::testing::Test {
 protected:
  CandidateSetTest() : stars_(4, 1, {1, CentreRule::kTangentSpace}) {
    AppendTo(&stars_, FlatSample(2, 4, 50, 1));
    stars_.Commit();
    std::vector<std::uint32_t> all(50);
    for (std::uint32_t p = 0; p < 50; ++p) all[p] = p;
    book_.Update(50, all, {});
    Specification spec;
    spec.dimension = 2;
    spec.ambient_dimension = 4;
    spec.epsilon = 1;
    spec.criteria.candidates = 7;
    criteria_ = Resolve(spec);
  }

  Target<2> TargetOf(std::uint32_t star, Rule rule) const {
    Violation<2> violation;
    violation.rule = rule;
    violation.radius = violation.x[0] = kRadius;
    return TargetFor<2>(star, violation, 1, 1, book_.failed_attempts(star));
  }
  CandidateSet<2> Draw(const Drawing& drawing = {true, 1, 1}) const {
    return DrawCandidates<2>(stars_, book_, criteria_, drawing,
                             {TargetOf(3, Rule::kSize), TargetOf(5, Rule::kShape)});
  }
  Eigen::Vector4d CentreOf(std::uint32_t star) const {
    return Eigen::Map<const Eigen::Vector4d>(stars_.sample().Point(star)) +
           Eigen::Vector4d(kRadius, 0, 0, 0);
  }

  Stars<2> stars_;
  ViolationIndex<2> book_;
  ResolvedCriteria criteria_;
};

TEST_F(CandidateSetTest, HasOneForR1AndSeveralForR3) {
  const CandidateSet<2> set = Draw();
  EXPECT_EQ(set.first, (std::vector<Eigen::Index>{0, 1, 8}));
  EXPECT_EQ(set.size(), 8);
  EXPECT_EQ(set.points.col(0), CentreOf(3));
  EXPECT_EQ(set.points.col(1), CentreOf(5));
  for (Eigen::Index c = 2; c < 8; ++c) {
    const double off = (set.points.col(c) - CentreOf(5)).norm();
    EXPECT_GT(off, 0);
    EXPECT_LE(off, criteria_.picking_radius * kRadius * (1 + 1e-12));
  }
}

TEST_F(CandidateSetTest, GoesOffTheCentreOnceThatHasFailed) {
  book_.NoteFailedAttempt(3);
  const double off = (Draw().points.col(0) - CentreOf(3)).norm();
  EXPECT_GT(off, 0);
  EXPECT_LE(off, criteria_.picking_radius * kRadius * (1 + 1e-12));
}

TEST_F(CandidateSetTest, IsDrawnBySeedRoundAndStarAlone) {
  const Eigen::MatrixXd points = Draw().points;
  EXPECT_EQ(Draw().points, points);
  EXPECT_NE(Draw({true, 2, 1}).points, points);
  EXPECT_NE(Draw({true, 1, 2}).points, points);
}

TEST_F(CandidateSetTest, AsksForFlatsWhereTheyWereFoundSoFar) {
  EXPECT_EQ(Draw().in_flats, (std::vector<std::uint8_t>{1, 1}));
  book_.NoteNoFlat(5);
  EXPECT_EQ(Draw().in_flats, (std::vector<std::uint8_t>{1, 0}));
  EXPECT_EQ(Draw({false, 1, 1}).in_flats, (std::vector<std::uint8_t>{0, 0}));
}

TEST(TargetFor, StepsNoFartherThanItMayAndNearerAfterFailures) {
  Violation<2> violation;
  violation.radius = violation.x[1] = 8;
  const Target<2> far = TargetFor<2>(0, violation, 1, 2, 0);
  EXPECT_TRUE(far.is_coarse());
  EXPECT_EQ(far.radius, 2);
  EXPECT_EQ(far.x[1], 2);
  EXPECT_EQ(TargetFor<2>(0, violation, 1, 2, 3).radius, 0.25);
  EXPECT_EQ(TargetFor<2>(0, violation, 5, 2, 3).radius, 2);  // not coarse
  violation.rule = Rule::kInconsistent;
  EXPECT_EQ(TargetFor<2>(0, violation, 1, 2, 3).radius, 8);
}

}  // namespace
}  // namespace stellate::core
