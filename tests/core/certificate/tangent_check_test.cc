// Tangent spaces are compared with closest points on the mesh's own scale at each vertex.

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "core/certificate/certifier.h"
#include "tests/core/certificate/handmade_meshes.h"
#include "tests/core/support/says.h"

namespace stellate::core {
namespace {

using testing::Says;

// The ellipse x = A cos t, y = sin t, whose tips have the radius 1 / A.
constexpr double kA = 100;

Eigen::VectorXd PointAt(double t) { return Eigen::Vector2d(kA * std::cos(t), std::sin(t)); }
Eigen::VectorXd TangentAt(double t) {
  return Eigen::Vector2d(-kA * std::sin(t), std::cos(t)).normalized();
}

double ParameterOf(const Eigen::VectorXd& x) {  // of the nearest point
  double best = 0, least = 1e300;
  for (int i = 0; i < 720; ++i) {
    const double t = 2 * std::numbers::pi * i / 720;
    if (const double squared = (PointAt(t) - x).squaredNorm(); squared < least) {
      least = squared;
      best = t;
    }
  }
  // Newton's steps, halved while they lead away.
  for (int n = 0; n < 50; ++n) {
    const Eigen::Vector2d off = PointAt(best) - x, first(-kA * std::sin(best), std::cos(best));
    const double slope = off.dot(first), bend = first.squaredNorm() - off.dot(PointAt(best));
    double step = bend > 0 ? -slope / bend : -1e-3 * slope;
    while (std::abs(step) > 1e-15 && (PointAt(best + step) - x).squaredNorm() > off.squaredNorm())
      step /= 2;
    best += step;
  }
  return best;
}

Eigen::VectorXd ClosestOnEllipse(const Eigen::VectorXd& x) { return PointAt(ParameterOf(x)); }

// Edges are 0.4 of half the width, and of the radius at the tips: as size_rate makes them. They
// grow from the tips on, so that one quarter is sampled and mirrored.
HandmadeMesh Graded() {
  std::set<double> at{std::numbers::pi / 2, 3 * std::numbers::pi / 2};
  for (double t = 0; t < std::numbers::pi / 2 - 0.002;) {
    for (const double mirrored : {t, std::numbers::pi - t, std::numbers::pi + t})
      at.insert(mirrored);
    if (t > 0) at.insert(2 * std::numbers::pi - t);
    const double speed = std::hypot(kA * std::sin(t), std::cos(t));
    t += 0.4 * std::max(1 / kA, std::sin(t)) / speed;
  }
  HandmadeMesh mesh;
  for (const double t : at) mesh.AddVertex(PointAt(t), TangentAt(t));
  const std::uint32_t n = mesh.vertices();
  for (std::uint32_t v = 0; v < n; ++v) mesh.AddSimplex({v, (v + 1) % n});
  return mesh;
}

Certificate CertifyEllipse(double size_ratio, double turned) {
  const HandmadeMesh mesh = Graded();
  Specification spec = SpecificationFor(mesh, 0.6);
  spec.oracle.tangent_basis = true;
  StarFacts facts{0, 0, true};
  facts.max_size_ratio = size_ratio;
  HandmadeMesh given = mesh;
  const auto turn = [turned](const Eigen::VectorXd& y) -> Eigen::MatrixXd {
    return Eigen::Rotation2Dd(turned) * TangentAt(ParameterOf(y));
  };
  for (std::uint32_t v = 0; v < given.vertices(); ++v) {
    const Eigen::MatrixXd tangent = turn(given.Point(v));
    for (int i = 0; i < 2; ++i) given.tangents[2 * v + i] = tangent(i, 0);
  }
  return Certify(spec, given, ClosestOnEllipse, facts, turn).certificate;
}

TEST(TangentCheck, DoesNotAccuseARightOracleOfAGradedMesh) {
  const Certificate c = CertifyEllipse(0.35, 0);
  EXPECT_TRUE(c.certified) << c.verdict;
}

TEST(TangentCheck, AccusesTangentsThatAreWrongOnAGradedMesh) {
  const Certificate c = CertifyEllipse(0.35, 0.4);
  EXPECT_FALSE(c.certified);
  EXPECT_TRUE(Says(c.verdict, "the tangent space that the oracle gave is not that")) << c.verdict;
}

// Where all sizes are one the tips are too sharp for it: that, and not the oracle, is at fault.
TEST(TangentCheck, TellsABendWithinAStepFromWrongTangents) {
  const Certificate c = CertifyEllipse(0, 0);
  EXPECT_FALSE(c.certified);
  EXPECT_FALSE(Says(c.verdict, "tangent bases")) << c.verdict;
  EXPECT_TRUE(Says(c.verdict, "too coarse")) << c.verdict;
  EXPECT_TRUE(Says(c.verdict, "size_rate 0.4")) << c.verdict;
  EXPECT_NEAR(c.estimated_reach, 1 / kA, 0.3 / kA);
  EXPECT_FALSE(c.only_too_coarse) << "ten times as coarse says nothing for it";
}

}  // namespace
}  // namespace stellate::core
