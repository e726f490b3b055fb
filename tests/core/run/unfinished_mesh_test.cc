// A run that ends before it has finished hands out what its stars agree on: never vertices alone.

#include <gtest/gtest.h>

#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using stellate::testing::Domain;
using stellate::testing::MeshOf;
using stellate::testing::WallMesh;

void ExpectAMesh(const WallMesh& mesh) {
  const Report& report = mesh.report;
  EXPECT_FALSE(report.certificate.certified);
  EXPECT_EQ(report.certificate.verdict.find("not certified: "), 0u) << report.certificate.verdict;
  EXPECT_GT(mesh.simplices.size(), mesh.points.size() / 2)
      << mesh.points.size() << " vertices; " << report.certificate.verdict;
  EXPECT_EQ(report.counts.simplices, mesh.simplices.size())
      << "the deltas say what the report does";
  EXPECT_EQ(report.counts.vertices, mesh.points.size());
}

// From a budget that its corners use up to one that its inside does.
TEST(UnfinishedMesh, HasSimplicesWhateverStageItWasIn) {
  const Domain solid = stellate::testing::DrilledBox();
  const std::size_t whole = MeshOf(solid, solid.SpecificationFor(0.4)).points.size();
  for (std::size_t budget = 40; budget < whole; budget += 60) {
    SCOPED_TRACE(budget);
    Specification spec = solid.SpecificationFor(0.4);
    spec.limits.max_vertices = budget;
    const WallMesh mesh = MeshOf(solid, spec);
    EXPECT_EQ(mesh.report.termination, Termination::kVertexBudget);
    ExpectAMesh(mesh);
  }
}

TEST(UnfinishedMesh, HasSimplicesWhateverRoundItWasIn) {
  const Domain solid = stellate::testing::DrilledBox();
  const std::uint64_t rounds = MeshOf(solid, solid.SpecificationFor(0.4)).report.counts.rounds;
  for (std::uint64_t most = 4; most + 2 < rounds; most += 3) {
    SCOPED_TRACE(most);
    Specification spec = solid.SpecificationFor(0.4);
    spec.limits.max_rounds = most;
    const WallMesh mesh = MeshOf(solid, spec);
    EXPECT_EQ(mesh.report.termination, Termination::kRoundBudget);
    if (mesh.points.size() > 60) ExpectAMesh(mesh);
  }
}

TEST(UnfinishedMesh, WithoutWallsIsTheSame) {
  Domain sphere = stellate::testing::Make(2, 3, 1.3, {1, 0, 1}, {});
  sphere.equations = {stellate::testing::BallOf(Eigen::Vector3d::Zero(), 1, 1, 3)};
  for (const std::uint64_t most : {3, 6, 9}) {
    Specification spec = sphere.SpecificationFor(0.05);
    spec.limits.max_rounds = most;
    const WallMesh mesh = MeshOf(sphere, spec);
    EXPECT_EQ(mesh.report.termination, Termination::kRoundBudget);
    if (mesh.points.size() > 30) ExpectAMesh(mesh);
  }
}

// Two sheets at 18 degrees with walls of a box: no protecting balls help, as far as is known.
TEST(UnfinishedMesh, FacesThatAreRefinedWithoutEndAreLeft) {
  const Domain sheets = stellate::testing::GyroidSheets(0.8);
  Specification spec = sheets.SpecificationFor(0.45);
  spec.random_seed = 1;
  const WallMesh mesh = MeshOf(sheets, spec);
  EXPECT_EQ(mesh.report.termination, Termination::kNoProgress);
  ExpectAMesh(mesh);
  EXPECT_NE(mesh.report.certificate.verdict.find("could not be fixed at "), std::string::npos)
      << mesh.report.certificate.verdict;
}

}  // namespace
}  // namespace stellate::core
