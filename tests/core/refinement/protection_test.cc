// Whole runs with protection: reached with few more vertices, the same for any number of threads,
// and told where it is not reached.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/says.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::Says;
using testing::SpecificationFor;

struct Asked {
  const char* manifold;
  double epsilon, protection;
  double most;  // vertices, by those without protection
};
void PrintTo(const Asked& c, std::ostream* out) {
  *out << c.manifold << " at " << c.epsilon << ", " << c.protection;
}

class Protected : public ::testing::TestWithParam<Asked> {};

TEST_P(Protected, IsReachedWithFewMoreVertices) {
  const auto manifold = Make(GetParam().manifold);
  Specification spec = SpecificationFor(*manifold, GetParam().epsilon);
  const DrivenRun plain = Drive(spec, *manifold);
  EXPECT_FALSE(plain.report().certificate.protection);
  EXPECT_EQ(plain.report().counts.inserted_protection, 0u);
  spec.criteria.protection = GetParam().protection;
  const DrivenRun run = Drive(spec, *manifold, {.threads = 1});
  const Certificate& c = run.report().certificate;
  ASSERT_TRUE(c.certified) << c.verdict;
  ASSERT_TRUE(c.protection);
  EXPECT_EQ(c.protection->weak, 0u) << c.warnings.front();
  EXPECT_TRUE(c.warnings.empty()) << c.warnings.front();
  const double asked = GetParam().protection * GetParam().epsilon;
  EXPECT_EQ(c.protection->asked, asked);
  EXPECT_GE(c.protection->least, asked * (1 - 1e-6));
  EXPECT_GT(c.protection->stability_radius, 0);
  EXPECT_GT(c.protection->thickness_bound, 0);
  EXPECT_FALSE(c.protection->is_delaunay);  // no reach is declared
  EXPECT_LE(c.max_circumradius, GetParam().epsilon * (1 + 1e-6));
  const auto vertices = static_cast<double>(plain.report().counts.vertices);
  EXPECT_LE(static_cast<double>(run.report().counts.vertices), GetParam().most * vertices);
  EXPECT_EQ(run.mesher->progress().bad_protection, 0u);

  EXPECT_TRUE(testing::SameMesh(*run.mesher, *Drive(spec, *manifold, {.threads = 3}).mesher));
}

INSTANTIATE_TEST_SUITE_P(Catalogue, Protected,
                         ::testing::Values(Asked{"circle:10", 0.3, 0.1, 1.12},
                                           Asked{"torus:1:0.4", 0.1, 0.1, 1.12},
                                           Asked{"clifford-torus", 0.28, 0.1, 1.12},
                                           Asked{"sphere:3:4", 0.4, 0.02, 1.2}));

TEST(Protection, IsMeasuredTooWhereItIsNotReached) {
  const auto manifold = Make("sphere:3:4");
  Specification spec = SpecificationFor(*manifold, 0.5);
  spec.criteria.protection = kMaxProtectionOfSolids;
  spec.criteria.candidates = 1;
  const DrivenRun run = Drive(spec, *manifold);
  const Certificate& c = run.report().certificate;
  EXPECT_TRUE(c.certified) << c.verdict;
  ASSERT_TRUE(c.protection);
  ASSERT_GT(c.protection->weak, 0u);
  EXPECT_LT(c.protection->least, c.protection->asked);
  ASSERT_EQ(c.protection->worst.size(), 4u);
  ASSERT_FALSE(c.warnings.empty());
  EXPECT_TRUE(Says(c.warnings.back(), "was not reached")) << c.warnings.back();
}

TEST(Protection, OfASpeculativeRunIsReached) {
  const auto manifold = Make("torus:1:0.4");
  Specification spec = SpecificationFor(*manifold, 0.2);
  spec.criteria.protection = 0.1;
  spec.criteria.speculative = true;
  const DrivenRun run = Drive(spec, *manifold);
  ASSERT_TRUE(run.report().certificate.protection);
  EXPECT_EQ(run.report().certificate.protection->weak, 0u);
}

}  // namespace
}  // namespace stellate::core
