// Whole runs with a declared reach: proved where it is true, refuted or unproved where it is not.

#include <gtest/gtest.h>

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
using testing::TopologyOf;

struct ReachCase {
  std::string manifold;
  double share;  // epsilon, of the reach
  bool tangents = true;
};

void PrintTo(const ReachCase& c, std::ostream* out) {
  *out << c.manifold << " at " << c.share << (c.tangents ? "" : " without tangents");
}

Specification Declared(Manifold& manifold, double epsilon, double reach) {
  Specification spec = SpecificationFor(manifold, epsilon);
  spec.declared_reach = reach;
  return spec;
}

template <typename Closest>
DrivenRun DriveClosest(const Specification& spec, const Closest& closest) {
  return Drive(spec, [&](const QueryBatch& batch) {
    Answers answers;
    for (const QueryBlock& block : batch.blocks) {
      AnswerBlock& answer = answers.blocks.emplace_back();
      answer.points.resize(spec.ambient_dimension, block.size());
      for (Eigen::Index i = 0; i < block.size(); ++i)
        answer.points.col(i) = closest(Eigen::VectorXd(block.points.col(i)));
    }
    return answers;
  });
}

class TrueReach : public ::testing::TestWithParam<ReachCase> {};

TEST_P(TrueReach, ProvesTheMesh) {
  const auto manifold = Make(GetParam().manifold);
  const double reach = *manifold->facts().reach;
  Specification spec = Declared(*manifold, GetParam().share * reach, reach);
  spec.oracle.tangent_basis = GetParam().tangents;
  const DrivenRun run = Drive(spec, *manifold);
  const Certificate& c = run.report().certificate;
  EXPECT_EQ(c.level, CertificateLevel::kProved)
      << c.verdict << (c.warnings.empty() ? "" : "; " + c.warnings.front());
  EXPECT_TRUE(c.certified);
  EXPECT_FALSE(c.reach_refuted);
  EXPECT_EQ(c.declared_reach, reach);
  EXPECT_TRUE(Says(c.verdict, "as declared")) << c.verdict;
  EXPECT_GE(c.proved_distance, c.max_barycentre_distance);
  EXPECT_LT(c.proved_distance, reach);
  const testing::Topology topology = TopologyOf(run.mesher->Simplices(), manifold->dimension());
  EXPECT_EQ(topology.euler_characteristic, manifold->facts().euler_characteristic);
}

INSTANTIATE_TEST_SUITE_P(
    Catalogue, TrueReach,
    ::testing::Values(ReachCase{"circle:10", 0.4}, ReachCase{"sphere:2:3", 0.4},
                      ReachCase{"sphere:2:3", 1}, ReachCase{"torus:1:0.4", 0.25},
                      ReachCase{"torus:1:0.4", 0.25, false}, ReachCase{"torus:1:0.4", 1},
                      ReachCase{"two-spheres", 0.4}, ReachCase{"ellipsoid:1:0.8:0.6", 0.4},
                      ReachCase{"clifford-torus", 0.2}, ReachCase{"clifford-torus@20", 0.3, false},
                      ReachCase{"rp2", 0.3}, ReachCase{"sphere:3:4", 0.4},
                      ReachCase{"flat-torus:3", 0.4}, ReachCase{"so3", 0.4}));

// Federer's bound of neighbours, or a ball, or a barycentre, tells.
TEST(DeclaredReach, IsRefutedWhereItIsTooLarge) {
  for (const char* name : {"sphere:2:3", "torus:1:0.4", "clifford-torus", "sphere:3:4"}) {
    const auto manifold = Make(name);
    const double reach = *manifold->facts().reach;
    for (const double times : {1.5, 10.0}) {
      const DrivenRun run = Drive(Declared(*manifold, 0.3 * reach, times * reach), *manifold);
      const Certificate& c = run.report().certificate;
      EXPECT_TRUE(c.reach_refuted) << name << " declared " << times << " times: " << c.verdict;
      EXPECT_EQ(c.level, CertificateLevel::kRefused);
      EXPECT_FALSE(c.certified);
      EXPECT_TRUE(Says(c.verdict, "at most")) << c.verdict;
    }
  }
}

TEST(DeclaredReach, MakesTheMeshAsFineAsTheProofNeeds) {
  const auto manifold = Make("sphere:2:3");
  const DrivenRun coarse = Drive(SpecificationFor(*manifold, 0.4), *manifold);
  const DrivenRun fine = Drive(Declared(*manifold, 0.4, 0.3), *manifold);
  EXPECT_EQ(fine.report().certificate.level, CertificateLevel::kProved);
  EXPECT_GT(fine.report().counts.vertices, 2 * coarse.report().counts.vertices);
}

TEST(DeclaredReach, ChangesNothingWhereItIsNotDeclared) {
  const auto manifold = Make("sphere:2:3");
  const DrivenRun run = Drive(SpecificationFor(*manifold, 0.4), *manifold);
  const Certificate& c = run.report().certificate;
  EXPECT_EQ(c.level, CertificateLevel::kSampled);
  EXPECT_EQ(c.declared_reach, 0);
  EXPECT_EQ(c.proved_distance, 0);
}

TEST(DeclaredReach, CoversTheBox) {
  const auto manifold = Make("two-spheres");
  Specification spec = Declared(*manifold, 0.2, 0.5);
  spec.seeds.resize(0, 0);
  spec.cover_box = true;
  ASSERT_TRUE(Validate(spec).ok()) << Validate(spec).message;
  const DrivenRun run = Drive(spec, *manifold);
  const Certificate& c = run.report().certificate;
  EXPECT_EQ(c.level, CertificateLevel::kProved) << c.verdict;
  EXPECT_EQ(c.components, 2u);
  EXPECT_TRUE(Says(c.verdict, "all components")) << c.verdict;
  EXPECT_FALSE(Says(c.verdict, "cannot be excluded")) << c.verdict;
}

// A unit sphere without the cap around its last axis, whose rim has radius `hole`: an arc with a
// gap where x has two coordinates. Its reach is `hole` at most.
Eigen::VectorXd ClosestOutsideCap(const Eigen::VectorXd& x, double hole) {
  const Eigen::Index last = x.size() - 1;
  Eigen::VectorXd y = x.normalized();
  if (y[last] <= 0 || y.head(last).norm() >= hole) return y;
  Eigen::VectorXd rim = Eigen::VectorXd::Unit(x.size(), 0);
  if (y.head(last).norm() > 0) rim.head(last) = y.head(last).normalized();
  rim *= hole;
  rim[last] = std::sqrt(1 - hole * hole);
  return rim;
}

// With the true reach of what ends declared, the mesh gets too fine to close over the end.
TEST(DeclaredReach, ProvesNothingWhereTheManifoldEnds) {
  for (const int k : {1, 2})
    for (const double hole : {0.1, 0.3})
      for (const double epsilon : {0.5, 2.0}) {
        Specification spec;
        spec.dimension = k;
        spec.ambient_dimension = k + 1;
        spec.epsilon = epsilon * hole;
        spec.declared_reach = hole;
        spec.seeds = -Eigen::VectorXd::Unit(k + 1, k);
        spec.limits.max_vertices = 3000;
        const DrivenRun run = DriveClosest(
            spec, [hole](const Eigen::VectorXd& x) { return ClosestOutsideCap(x, hole); });
        EXPECT_EQ(run.report().certificate.level, CertificateLevel::kRefused)
            << "k " << k << ", hole " << hole << ", epsilon " << spec.epsilon << ": "
            << run.report().certificate.verdict;
      }
}

TEST(DeclaredReach, ProvesGradedMeshes) {
  const auto manifold = Make("ellipsoid:1:0.8:0.6");
  const double reach = *manifold->facts().reach;
  Specification spec = Declared(*manifold, 0.5 * reach, reach);
  spec.criteria.size_rate = 0.4;
  const DrivenRun run = Drive(spec, *manifold);
  const Certificate& c = run.report().certificate;
  EXPECT_EQ(c.level, CertificateLevel::kProved)
      << c.verdict << (c.warnings.empty() ? "" : "; " + c.warnings.front());
}

// Eight spheres of radius 0.1 in the corners of a box: each is found.
TEST(DeclaredReach, CoversABoxOfSmallComponents) {
  Specification spec;
  spec.dimension = 2;
  spec.ambient_dimension = 3;
  spec.epsilon = 0.05;
  spec.declared_reach = 0.1;
  spec.cover_box = true;
  spec.bounding_box = BoundingBox{Eigen::Vector3d::Constant(-1), Eigen::Vector3d::Constant(1)};
  const DrivenRun run = DriveClosest(spec, [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    Eigen::Vector3d centre;
    for (int i = 0; i < 3; ++i) centre[i] = x[i] < 0 ? -0.85 : 0.85;
    return centre + 0.1 * (x - centre).normalized();
  });
  const Certificate& c = run.report().certificate;
  EXPECT_EQ(c.components, 8u) << c.verdict;
  EXPECT_EQ(c.level, CertificateLevel::kProved) << c.verdict;
}

TEST(DeclaredReach, IsRefusedWhereItMakesNoSense) {
  const auto manifold = Make("sphere:2:3");
  for (const double reach : {0.0, -1.0, std::nan(""), HUGE_VAL})
    EXPECT_EQ(Validate(Declared(*manifold, 0.4, reach)).code, StatusCode::kInvalidArgument)
        << reach;
  Specification spec = SpecificationFor(*manifold, 0.4);
  spec.seeds.resize(0, 0);
  spec.cover_box = true;
  EXPECT_EQ(Validate(spec).code, StatusCode::kInvalidArgument);
  spec.declared_reach = 1e-3;
  const Status status = Validate(spec);
  EXPECT_EQ(status.code, StatusCode::kLimitExceeded);
  EXPECT_TRUE(Says(status.message, "cover_box has to place")) << status.message;
}

}  // namespace
}  // namespace stellate::core
