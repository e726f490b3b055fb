#include "core/certificate/evidence/evidence.h"

#include <gtest/gtest.h>

#include <string>

#include "core/certificate/certifier.h"
#include "core/geometry/reach_bound.h"
#include "tests/core/certificate/handmade_meshes.h"
#include "tests/core/support/says.h"

namespace stellate::core {
namespace {

using testing::Says;

// The unit sphere, and another around the same centre.
ClosestPoint Concentric(double radius) {
  return [radius](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return (x.norm() < (1 + radius) / 2) == (radius < 1) ? radius * x.normalized() : x.normalized();
  };
}

std::vector<double> LongestEdges(const HandmadeMesh& mesh, double length) {
  return std::vector<double>(mesh.vertices(), length);
}

TEST(Evidence, PointsOfTheMeshAreNoEvidenceAgainstIt) {
  const HandmadeMesh mesh = Icosphere(3);
  std::vector<double> on;
  for (std::uint32_t v = 0; v + 1 < mesh.vertices(); ++v) {
    const Eigen::Vector3d sum = mesh.Point(v) + mesh.Point(v + 1);
    if (sum.norm() < 1) continue;
    const Eigen::Vector3d y = sum.normalized();
    on.insert(on.end(), y.begin(), y.end());
  }
  const Evidence evidence =
      CompareWithMesh(mesh.View(), on, LongestEdges(mesh, 0.2), 0.15, false, 1e-15, 100);
  EXPECT_GE(evidence.reach, 0.25);  // as far as it looks, or 1
  EXPECT_TRUE(evidence.uncovered.empty());
}

TEST(Evidence, ASheetNearerThanAnEdgeBoundsTheReach) {
  const HandmadeMesh mesh = Icosphere(3);
  const Eigen::Vector3d y = 0.98 * mesh.Point(7);
  const Evidence evidence = CompareWithMesh(mesh.View(), {y[0], y[1], y[2]},
                                            LongestEdges(mesh, 0.15), 0.1, false, 1e-12, 1);
  EXPECT_NEAR(evidence.reach, 0.01, 1e-9);
  EXPECT_EQ(evidence.narrowest, 0u);
  EXPECT_EQ(evidence.vertex, 7u);
  EXPECT_NEAR(evidence.distance, 0.02, 1e-12);
}

TEST(Evidence, WhatTheOraclesOwnErrorExplainsTellsNothing) {
  EXPECT_TRUE(IsTelling(0.02, 0.02, 0.15, 0.001));
  EXPECT_FALSE(IsTelling(0.02, 0.02, 0.15, 0.01));
  EXPECT_FALSE(IsTelling(0.02, 0.002, 0.15, 0));  // near, and along the surface
  EXPECT_TRUE(IsTelling(0.1, 0.002, 0.15, 0));    // far
}

TEST(Evidence, APointFarFromAllVerticesIsUncovered) {
  const HandmadeMesh mesh = Icosphere(3);
  const Evidence evidence = CompareWithMesh(mesh.View(), {1, 0, 0, 5, 0, 0, 0, 1.3, 0},
                                            LongestEdges(mesh, 0.15), 0.1, false, 0, 1);
  EXPECT_EQ(evidence.uncovered, (std::vector<std::uint64_t>{1, 2}));
}

TEST(Evidence, RefusesASheetThatTheMeshStandsForToo) {
  const HandmadeMesh mesh = Icosphere(3);
  for (const double radius : {0.98, 1.02, 0.9}) {
    const Certificate c =
        Certify(SpecificationFor(mesh, 0.2), mesh, Concentric(radius)).certificate;
    EXPECT_FALSE(c.certified) << radius;
    EXPECT_TRUE(Says(c.verdict, "too coarse to trust")) << c.verdict;
    EXPECT_NEAR(c.estimated_reach, std::abs(1 - radius) / 2, 1e-6);
    // Fibres of the other sheet meet the mesh once, but too far away.
    if (radius == 0.9) {
      EXPECT_GT(c.fibre_failures, 0u);
    }
  }
}

TEST(Evidence, RefusesATooCoarseMeshAndNeverWarnsOfACertifiedOne) {
  for (const int levels : {1, 2, 3}) {
    const HandmadeMesh mesh = Icosphere(levels);
    const Certificate c = Certify(SpecificationFor(mesh, 3), mesh, ClosestOnSphere).certificate;
    EXPECT_TRUE(c.certified) << c.verdict;
    EXPECT_TRUE(c.warnings.empty());
  }
  const HandmadeMesh octahedron = Icosphere(0);  // of circumradius 0.82
  const Certificate c =
      Certify(SpecificationFor(octahedron, 3), octahedron, ClosestOnSphere).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "too coarse to trust")) << c.verdict;
}

TEST(Evidence, RefusesTangentsThatAreNotThoseOfTheClosestPoints) {
  const HandmadeMesh mesh = Icosphere(3);
  Specification spec = SpecificationFor(mesh, 0.2);
  spec.oracle.tangent_basis = true;
  // The wall between two spheres, which has three dimensions.
  const auto wall = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return std::clamp(x.norm(), 0.9999, 1.0) * x.normalized();
  };
  const auto thick_wall = [](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    return std::clamp(x.norm(), 0.95, 1.0) * x.normalized();
  };
  const Certificate thick = Certify(spec, mesh, thick_wall, {0, 0, true}, Complement).certificate;
  EXPECT_FALSE(thick.certified);
  EXPECT_TRUE(Says(thick.verdict, "tangent space that the oracle gave")) << thick.verdict;
  EXPECT_FALSE(Certify(spec, mesh, wall, {0, 0, true}, Complement).certificate.certified);
}

TEST(Evidence, RefusesAMeshOverAnUndeclaredBoundary) {
  const HandmadeMesh mesh = Icosphere(4);
  // Inside a triangle, off its middle.
  const std::uint32_t* ids = mesh.simplices.data();
  const Eigen::Vector3d middle =
      (1.1 * mesh.Point(ids[0]) + mesh.Point(ids[1]) + mesh.Point(ids[2])).normalized();
  const auto punctured = [middle](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    const Eigen::Vector3d y = x.normalized();
    const double radius = 0.02, height = std::sqrt(1 - radius * radius);
    if (y.dot(middle) <= height) return y;
    return height * middle + radius * (y - y.dot(middle) * middle).normalized();
  };
  const Certificate c = Certify(SpecificationFor(mesh, 0.1), mesh, punctured).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "the manifold ends")) << c.verdict;
  Certificate whole = Certify(SpecificationFor(mesh, 0.1), mesh, ClosestOnSphere).certificate;
  EXPECT_TRUE(Says(whole.verdict, "Assumed: that the manifold has no boundary")) << whole.verdict;
}

TEST(Evidence, RefusesFewerComponentsThanDeclared) {
  const HandmadeMesh mesh = Icosphere(3);
  Specification spec = SpecificationFor(mesh, 0.2);
  spec.components = 1;
  EXPECT_TRUE(Certify(spec, mesh, ClosestOnSphere).certificate.certified);
  spec.components = 2;
  const Certificate c = Certify(spec, mesh, ClosestOnSphere).certificate;
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "1 component where 2 were declared")) << c.verdict;
}

TEST(Evidence, AThoroughAuditAsksAboutEveryVertexAndSimplex) {
  const HandmadeMesh mesh = Icosphere(4);
  Specification spec = SpecificationFor(mesh, 0.1);
  const CertifiedRun standard = Certify(spec, mesh, ClosestOnSphere);
  spec.audit = Audit::kThorough;
  const CertifiedRun thorough = Certify(spec, mesh, ClosestOnSphere);
  EXPECT_TRUE(thorough.certificate.certified) << thorough.certificate.verdict;
  const auto n = static_cast<Eigen::Index>(mesh.vertices());
  EXPECT_GE(thorough.queries, 2 * n + 3 * 2 * (n - 2));
  EXPECT_LT(standard.queries, thorough.queries / 2);

  // A pocket at one vertex that no other question comes near.
  const Eigen::Vector3d at = mesh.Point(1001);
  const auto pocket = [at](const Eigen::VectorXd& x) -> Eigen::VectorXd {
    const Eigen::VectorXd inner = 0.8 * at + 0.01 * (x - 0.8 * at).normalized();
    return (x - inner).norm() < std::abs(x.norm() - 1) ? inner : Eigen::VectorXd(x.normalized());
  };
  const Certificate found = Certify(spec, mesh, pocket).certificate;
  EXPECT_FALSE(found.certified) << found.verdict;
}

}  // namespace
}  // namespace stellate::core
