// What refinement does with answers that contradict the mesh, and with what has no end.

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/says.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::Says;

using Closest = Eigen::VectorXd (*)(const Eigen::VectorXd&);

testing::Answerer AnswererOf(Closest closest) {
  return [closest](const QueryBatch& batch) {
    Answers answers;
    for (const QueryBlock& block : batch.blocks) {
      AnswerBlock answer;
      answer.points.resize(block.points.rows(), block.size());
      for (Eigen::Index j = 0; j < block.size(); ++j)
        answer.points.col(j) = closest(block.points.col(j));
      answers.blocks.push_back(std::move(answer));
    }
    return answers;
  };
}

Specification SurfaceIn(double half_box, double epsilon) {
  Specification spec;
  spec.dimension = 2;
  spec.ambient_dimension = 3;
  spec.epsilon = epsilon;
  spec.bounding_box =
      BoundingBox{Eigen::Vector3d::Constant(-half_box), Eigen::Vector3d::Constant(half_box)};
  return spec;
}

// The unit sphere, and a smaller one beside it.
Eigen::VectorXd TwoSpheres(const Eigen::VectorXd& x) {
  const Eigen::Vector3d centre(3.5, 0, 0);
  const Eigen::VectorXd a = x.normalized();
  const Eigen::VectorXd b = centre + 0.6 * (x - centre).normalized();
  return (x - a).norm() <= (x - b).norm() ? a : b;
}

TEST(MissedParts, AComponentThatTheCertificateComesUponIsMeshedToo) {
  Specification spec = SurfaceIn(5, 0.2);
  spec.criteria.advance_step = 0.4;
  spec.seeds = Eigen::Vector3d(-1, 0, 0);
  const DrivenRun run = Drive(spec, AnswererOf(TwoSpheres));
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  EXPECT_EQ(run.report().certificate.components, 2u);
  EXPECT_EQ(run.report().certificate.euler_characteristic, 4);
  // And what the deltas tell is the mesh.
  std::set<std::vector<std::uint32_t>> told;
  for (const MeshDelta& delta : run.deltas) {
    for (std::size_t i = 0; i < delta.removed.size(); i += 3)
      EXPECT_EQ(told.erase({delta.removed.begin() + i, delta.removed.begin() + i + 3}), 1u);
    for (std::size_t i = 0; i < delta.added.size(); i += 3)
      EXPECT_TRUE(told.insert({delta.added.begin() + i, delta.added.begin() + i + 3}).second);
  }
  EXPECT_EQ(told.size(), run.report().counts.simplices);
}

// A sphere of radius 1, and one inside it.
Eigen::VectorXd Nested(const Eigen::VectorXd& x) {
  return (x.norm() < 0.95 ? 0.9 : 1) * x.normalized();
}

TEST(MissedParts, ASeedIsNeverDroppedForOneOfAnotherComponent) {
  Specification spec = SurfaceIn(3, 0.3);
  spec.seeds.resize(3, 2);
  spec.seeds << 1, 0.9, 0, 0, 0, 0;
  const DrivenRun coarse = Drive(spec, AnswererOf(Nested));
  EXPECT_FALSE(coarse.report().certificate.certified);
  spec.epsilon = 0.035;
  const DrivenRun fine = Drive(spec, AnswererOf(Nested));
  EXPECT_TRUE(fine.report().certificate.certified) << fine.report().certificate.verdict;
  EXPECT_EQ(fine.report().certificate.components, 2u);
}

Eigen::VectorXd Plane(const Eigen::VectorXd& x) { return Eigen::Vector3d(x[0], x[1], 0.1); }

TEST(MissedParts, APlaneIsStoppedOutsideItsBoxAndAskedAbout) {
  Specification spec = SurfaceIn(1, 0.2);
  spec.limits.max_vertices = 20'000;
  const DrivenRun run = Drive(spec, AnswererOf(Plane));
  EXPECT_EQ(run.report().termination, Termination::kNoProgress);
  EXPECT_TRUE(Says(run.report().certificate.verdict, "open or unbounded?"))
      << run.report().certificate.verdict;
  EXPECT_LT(run.report().counts.vertices, 5000u);
}

Eigen::VectorXd Sphere(const Eigen::VectorXd& x) { return x.normalized(); }

TEST(MissedParts, ABoxThatIsALittleTooSmallIsWarnedOf) {
  const DrivenRun run = Drive(SurfaceIn(0.7, 0.2), AnswererOf(Sphere));
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  ASSERT_EQ(run.report().certificate.warnings.size(), 1u);
  EXPECT_TRUE(Says(run.report().certificate.warnings[0], "leaves the bounding box"));
  EXPECT_TRUE(Drive(SurfaceIn(1.2, 0.2), AnswererOf(Sphere)).report().certificate.warnings.empty());
}

// The unit sphere without a cap of radius 0.14, less than epsilon.
Eigen::VectorXd Capless(const Eigen::VectorXd& x) {
  Eigen::VectorXd y = x.normalized();
  if (y[2] > 0.99) y << std::sqrt(1 - 0.99 * 0.99) * y.head(2).normalized(), 0.99;
  return y;
}

TEST(MissedParts, AHoleThatAnAnswerCameUponIsRefusedByName) {
  Specification spec = SurfaceIn(1.2, 0.2);
  for (const bool declared : {false, true}) {
    if (declared) spec.declared_reach = 0.14;
    const DrivenRun run = Drive(spec, AnswererOf(Capless));
    const Certificate& c = run.report().certificate;
    EXPECT_FALSE(c.certified);
    EXPECT_TRUE(Says(c.verdict, "the manifold ends")) << c.verdict;
  }
}

// A circle of radius 1 in the plane of |u| and z, u in R^3, that thin spheres are turned along.
Eigen::VectorXd ThinRing(const Eigen::VectorXd& x) {
  const Eigen::Vector3d out = x.head(3).normalized();
  Eigen::Vector2d section(x.head(3).norm() - 1, x[3]);
  section *= 0.007 / section.norm();
  Eigen::VectorXd y(4);
  y << (1 + section[0]) * out, section[1];
  return y;
}

// Epsilon is 25 times the reach: hardly a star closes, however far the front goes.
TEST(MissedParts, AManifoldFarThinnerThanEpsilonIsGivenUpSoon) {
  Specification spec;
  spec.dimension = 3;
  spec.ambient_dimension = 4;
  spec.epsilon = 0.17;
  spec.bounding_box =
      BoundingBox{Eigen::VectorXd::Constant(4, -1.1), Eigen::VectorXd::Constant(4, 1.1)};
  spec.limits.max_vertices = 8'000;
  const DrivenRun run = Drive(spec, AnswererOf(ThinRing));
  EXPECT_NE(run.report().termination, Termination::kConverged);
  EXPECT_LT(run.report().counts.rounds, 1000u);
  EXPECT_LT(run.report().counts.vertices, 4000u);
}

// Pairs of orthonormal vectors of R^4: V(2, 4), of dimension 5, in R^8.
Eigen::VectorXd Frames(const Eigen::VectorXd& x) {
  const Eigen::Map<const Eigen::MatrixXd> pair(x.data(), 4, 2);
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(pair, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return (svd.matrixU() * svd.matrixV().transpose()).reshaped();
}

// At common centres a cell may hold one simplex at two vertices: a delta tells it once.
TEST(MissedParts, DeltasTellASimplexOnceInFiveDimensions) {
  Specification spec;
  spec.dimension = 5;
  spec.ambient_dimension = 8;
  spec.epsilon = 0.9;
  spec.bounding_box =
      BoundingBox{Eigen::VectorXd::Constant(8, -1.1), Eigen::VectorXd::Constant(8, 1.1)};
  spec.limits.max_vertices = 100;
  const DrivenRun run = Drive(spec, AnswererOf(Frames));
  std::set<std::vector<std::uint32_t>> told;
  for (const MeshDelta& delta : run.deltas) {
    for (auto at = delta.removed.begin(); at != delta.removed.end(); at += 6)
      ASSERT_EQ(told.erase({at, at + 6}), 1u) << delta.revision;
    for (auto at = delta.added.begin(); at != delta.added.end(); at += 6)
      ASSERT_TRUE(told.insert({at, at + 6}).second) << delta.revision;
  }
  EXPECT_EQ(told.size(), run.report().counts.simplices);
}

}  // namespace
}  // namespace stellate::core
