#include "core/certificate/claims/proof.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/certificate/measure/star_geometry.h"
#include "tests/core/certificate/handmade_meshes.h"
#include "tests/core/support/says.h"

namespace stellate::core {
namespace {

using testing::Says;

Proof Prove(const HandmadeMesh& mesh, double reach, double tangent_error = 0) {
  const Adjacency adjacency(mesh.List());
  const MeshView view = mesh.View();
  const MeshShape shape = MeasureStars(view, adjacency).shape;
  return ProveFromReach(view, adjacency, shape, {reach, tangent_error});
}

TEST(Proof, ProvesASphereFromItsReach) {
  const Proof proof = Prove(Icosphere(2), 1);
  EXPECT_TRUE(proof.holds) << proof.obstacle;
  EXPECT_TRUE(proof.obstacle.empty());
}

TEST(Proof, TellsADistanceThatHoldsAndIsNotFarOff) {
  const HandmadeMesh mesh = Icosphere(2);
  double farthest = 0;  // barycentres of triangles are where a sphere is farthest
  for (std::size_t s = 0; s < mesh.size(); ++s) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (int i = 0; i < 3; ++i) middle += mesh.Point(mesh.simplices[3 * s + i]) / 3;
    farthest = std::max(farthest, 1 - middle.norm());
  }
  const Proof proof = Prove(mesh, 1);
  EXPECT_GE(proof.distance, farthest);
  EXPECT_LE(proof.distance, 1.1 * farthest);
}

TEST(Proof, FailsForAReachThatTheTrianglesAreTooLargeFor) {
  const HandmadeMesh mesh = Icosphere(1);
  EXPECT_TRUE(Prove(mesh, 1).holds);
  const Proof proof = Prove(mesh, 0.3);
  EXPECT_FALSE(proof.holds);
  EXPECT_TRUE(Says(proof.obstacle, "is tilted by")) << proof.obstacle;
  EXPECT_TRUE(Says(proof.obstacle, "reach")) << proof.obstacle;
}

TEST(Proof, NamesTheTiltedSimplex) {
  HandmadeMesh mesh = Icosphere(2);
  // The tangent space of vertex 7 turned upright.
  const Eigen::Vector3d normal = mesh.Point(7);
  const Eigen::MatrixXd across = Complement(normal);
  Eigen::Map<Eigen::MatrixXd> tangent(mesh.tangents.data() + 7 * 6, 3, 2);
  tangent.col(0) = normal;
  tangent.col(1) = across.col(0);
  const Proof proof = Prove(mesh, 1);
  EXPECT_FALSE(proof.holds);
  EXPECT_TRUE(Says(proof.obstacle, "7")) << proof.obstacle;
}

TEST(Proof, TangentsThatMayBeWrongCountAgainstIt) {
  const HandmadeMesh mesh = Icosphere(2);
  EXPECT_TRUE(Prove(mesh, 1, 0.5).holds);
  EXPECT_FALSE(Prove(mesh, 1, 1.4).holds);
}

// A second sheet over the first, as near as M may be to the mesh: both stars embed.
TEST(Proof, SeesASecondSheetOverAVertex) {
  HandmadeMesh mesh = Icosphere(2);
  HandmadeMesh other = Icosphere(2);
  for (double& x : other.points) x *= 1.001;
  mesh.Append(other);
  const Proof proof = Prove(mesh, 1);
  EXPECT_FALSE(proof.holds);
  EXPECT_TRUE(Says(proof.obstacle, "over one point")) << proof.obstacle;
}

TEST(Proof, HoldsForTwoSpheresApart) {
  HandmadeMesh mesh = Icosphere(2);
  HandmadeMesh other = Icosphere(2);
  for (std::size_t i = 0; i < other.points.size(); i += 3) other.points[i] += 4;
  mesh.Append(other);
  EXPECT_TRUE(Prove(mesh, 1).holds);
}

TEST(Proof, HoldsInOtherDimensionsAndUnits) {
  for (const auto& [k, n] : {std::pair{1, 24}, {2, 24}, {3, 20}}) {
    for (const double scale : {1e-6, 1.0, 1e6}) {
      HandmadeMesh mesh = TorusGrid(k, n, CliffordPoint);
      for (double& x : mesh.points) x *= scale;
      const Proof proof = Prove(mesh, scale);
      EXPECT_TRUE(proof.holds) << k << ": " << proof.obstacle;
      EXPECT_FALSE(Prove(mesh, 0.1 * scale).holds) << k;
    }
  }
}

TEST(Contradicts, WhatIsNoNearerToTheTangentSpaceThanACircleOfThatRadius) {
  const auto away = [](double turn) { return 1 - std::cos(turn); };  // of the unit circle
  const auto length = [](double turn) { return 2 * std::sin(turn / 2); };
  for (const double turn : {0.01, 0.3, 1.0, 3.0}) {
    EXPECT_FALSE(Contradicts({1, 0}, length(turn), away(turn), 0)) << turn;
    EXPECT_FALSE(Contradicts({0.5, 0}, length(turn), away(turn), 0)) << turn;
    EXPECT_TRUE(Contradicts({1.01, 0}, length(turn), away(turn), 0)) << turn;
    EXPECT_FALSE(Contradicts({1.01, 0}, length(turn), away(turn), 0.1 * length(turn))) << turn;
  }
  EXPECT_FALSE(Contradicts({1.01, 0.1}, length(0.01), away(0.01), 0));
}

}  // namespace
}  // namespace stellate::core
