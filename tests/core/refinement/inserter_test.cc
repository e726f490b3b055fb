#include "core/refinement/inserter.h"

#include <gtest/gtest.h>

#include "core/refinement/engine.h"
#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::Octahedron;
using testing::OnSphere;
using testing::SphereSpec;

// An octahedron on the sphere, all of whose stars are too large, and candidates to mend them.
class InserterTest : public ::testing::Test {
 protected:
  InserterTest()
      : criteria_(Resolve(SphereSpec(0.5))),
        stars_(3, criteria_.epsilon, {criteria_.inradius, criteria_.centre_rule}),
        sizes_(criteria_) {
    const AnsweredPoints seeds = OnSphere(Octahedron());
    for (Eigen::Index c = 0; c < 6; ++c)
      stars_.Add(seeds.points.col(c).data(), seeds.tangents.col(c).data());
    stars_.Commit();
    std::vector<std::uint32_t> all;
    std::vector<ViolationIndex<2>::Entry> entries;
    for (std::uint32_t p = 0; p < 6; ++p) {
      all.push_back(p);
      if (const auto worst = WorstSizeOrShape<2>(stars_, p, criteria_.epsilon, 2))
        entries.push_back({p, *worst});
    }
    book_.Update(6, all, std::move(entries));
    const auto& entry = book_.size_and_shape().front();
    candidates_ = DrawCandidates<2>(
        stars_, book_, criteria_, {true, 1, 1},
        {TargetFor<2>(entry.star, entry.violation, criteria_.epsilon, criteria_.advance_step, 0)});
    answers_ = OnSphere(candidates_.points);
  }

  Inserted Run(const Caution& caution = {}, std::uint64_t max_vertices = 100) {
    return Inserter<2>({stars_, sizes_, book_, criteria_, faces_, max_vertices}, candidates_,
                       answers_, caution)
        .Run();
  }

  std::uint32_t star() const { return candidates_.targets[0].star; }

  ResolvedCriteria criteria_;
  Stars<2> stars_;
  SizeField<2> sizes_;
  ViolationIndex<2> book_;
  BoundaryState<2> faces_{BoundaryPolicy::None(2)};
  CandidateSet<2> candidates_;
  AnsweredPoints answers_;
};

TEST_F(InserterTest, InsertsWhatCutsTheViolation) {
  const Inserted inserted = Run();
  EXPECT_EQ(inserted.used, std::vector<std::uint8_t>{1});
  EXPECT_EQ(inserted.rules, std::vector<Rule>{Rule::kSize});
  EXPECT_EQ(stars_.size(), 7u);
  EXPECT_EQ(book_.failed_attempts(star()), 0);
}

TEST_F(InserterTest, DoesNotInsertWhatIsThereAlready) {
  answers_.points.col(0) = Octahedron().col(0);
  const Inserted inserted = Run();
  EXPECT_EQ(inserted.used, std::vector<std::uint8_t>{0});
  EXPECT_EQ(inserted.duplicates, 1u);
  EXPECT_EQ(stars_.size(), 6u);
  EXPECT_EQ(book_.failed_attempts(star()), 1);
}

TEST_F(InserterTest, DoesNotInsertWhatMendsNothing) {
  answers_ = OnSphere(-candidates_.points);  // as far away as can be
  const Inserted inserted = Run();
  EXPECT_EQ(inserted.used, std::vector<std::uint8_t>{0});
  EXPECT_EQ(inserted.duplicates, 0u);
  EXPECT_EQ(book_.failed_attempts(star()), 1);
}

TEST_F(InserterTest, AsksForClosestPointsWhereAFlatDoesNotMeetM) {
  answers_.found[0] = 0;
  Run();
  EXPECT_TRUE(book_.has_no_flat(star()));
  EXPECT_EQ(book_.failed_attempts(star()), 0);
  candidates_.in_flats[0] = 0;
  Run();
  EXPECT_EQ(book_.failed_attempts(star()), 1);
}

TEST_F(InserterTest, LeavesAStarAloneThatASpeculationKnowsNothingOf) {
  answers_.found[0] = 0;
  Run(kSpeculativeCaution);
  EXPECT_TRUE(book_.is_given_up(star()));
  EXPECT_FALSE(book_.has_no_flat(star()));
}

TEST_F(InserterTest, InsertsPlannedPointsThatHaveRoomAsLongAsThereIsRoom) {
  PlannedPoints& planned = candidates_.planned;
  planned.points.resize(3, 3);
  planned.points << 1, 1, 1, 1, 1, -1, 0, 0, 1;  // the second where the first was
  planned.spacing = Eigen::Vector3d::Constant(0.5);
  planned.rules = {Rule::kRadiusEdge, Rule::kSize, Rule::kInconsistent};
  answers_ = OnSphere(candidates_);
  const Inserted all = Run();
  EXPECT_EQ(all.used, (std::vector<std::uint8_t>{1, 1, 0, 1}));
  EXPECT_EQ(all.rules, (std::vector<Rule>{Rule::kSize, Rule::kRadiusEdge, Rule::kInconsistent}));
  EXPECT_EQ(all.duplicates, 1u);
  const Inserted none = Run({}, stars_.size());
  EXPECT_EQ(none.used[1] + none.used[2] + none.used[3], 0);
}

}  // namespace
}  // namespace stellate::core
