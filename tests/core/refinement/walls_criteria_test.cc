// Sizes, speculative runs and omitted queries of manifolds with boundary.

#include <gtest/gtest.h>

#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using stellate::testing::BettiNumbers;
using stellate::testing::Domain;
using stellate::testing::MeshOf;
using stellate::testing::WallMesh;

void ExpectTheDomain(const WallMesh& mesh, const Domain& m) {
  EXPECT_TRUE(mesh.report.certificate.certified) << mesh.report.certificate.verdict;
  EXPECT_EQ(BettiNumbers(mesh.simplices), m.homology);
  EXPECT_EQ(BettiNumbers(mesh.Rim()), m.boundary_homology);
}

// A solid has no curvature but its walls'.
TEST(WallsCriteriaTest, MaxDeviationHoldsOnTheWallsOfASolid) {
  constexpr double kDeviation = 0.02;
  const Domain m = stellate::testing::Cylinder();
  Specification spec = m.SpecificationFor(0.7);
  const std::size_t coarse = MeshOf(m, spec).points.size();
  spec.criteria.max_deviation = kDeviation;
  const WallMesh mesh = MeshOf(m, spec);
  ExpectTheDomain(mesh, m);
  for (const auto& facet : mesh.Rim()) {
    Eigen::VectorXd barycentre = Eigen::VectorXd::Zero(3);
    WallSet walls = ~WallSet{0};
    for (const std::uint32_t v : facet) {
      barycentre += mesh.points[v] / 3;
      walls &= mesh.walls[v];
    }
    if (walls == SetOfWall(0)) {
      EXPECT_LE(1 - barycentre.head(2).norm(), kDeviation);
    }
  }
  EXPECT_GT(mesh.points.size(), coarse);
}

TEST(WallsCriteriaTest, MaxDeviationHoldsAlongTheRimOfAFlatDisc) {
  constexpr double kDeviation = 0.005;
  const Domain m = stellate::testing::Disc();
  Specification spec = m.SpecificationFor(0.5);
  spec.criteria.max_deviation = kDeviation;
  const WallMesh mesh = MeshOf(m, spec);
  ExpectTheDomain(mesh, m);
  for (const auto& edge : mesh.Rim())
    EXPECT_LE(1 - (mesh.points[edge[0]] + mesh.points[edge[1]]).norm() / 2, kDeviation);
}

TEST(WallsCriteriaTest, ASpeculativeRunTakesFewerRounds) {
  for (const Domain& m : {stellate::testing::HalfTorus(), stellate::testing::SolidTorus()}) {
    Specification spec = m.SpecificationFor(0.12);
    const WallMesh one_by_one = MeshOf(m, spec);
    spec.criteria.speculative = true;
    const WallMesh ahead = MeshOf(m, spec);
    ExpectTheDomain(ahead, m);
    EXPECT_LT(ahead.report.counts.rounds, one_by_one.report.counts.rounds);
  }
}

// Each point of it is its own closest point, and no wall is near.
TEST(WallsCriteriaTest, NothingIsAskedDeepInsideOfASolid) {
  constexpr double kDeep = 0.38;  // from the centre: farther from the wall than any step
  Domain m = stellate::testing::Ball();
  auto mesher = Mesher::Create(m.SpecificationFor(0.12));
  ASSERT_TRUE(mesher);
  int asked = 0, inserted = 0;
  while (const auto batch = (*mesher)->NextBatch()) {
    for (const QueryBlock& block : batch->blocks)
      for (Eigen::Index j = 0; j < block.size(); ++j)
        asked += (*mesher)->progress().phase == Phase::kRefining && block.face == 0 &&
                 block.points.col(j).norm() < kDeep;
    const auto delta = (*mesher)->Absorb(m.AnswersOf(*batch));
    ASSERT_TRUE(delta);
    for (Eigen::Index v = 0; v < delta->points.cols(); ++v)
      inserted += delta->points.col(v).norm() < kDeep;
  }
  const Certificate& c = (*mesher)->report().certificate;
  EXPECT_TRUE(c.certified) << c.verdict;
  EXPECT_LT(2 * asked, inserted);
}

}  // namespace
}  // namespace stellate::core
