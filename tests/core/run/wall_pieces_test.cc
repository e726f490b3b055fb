// Pieces of walls that are easily overlooked: voids, holes and caps beside others, sheets that are
// one wall together, ends of curves. A mesh that is certified ends at all of them; one that is not
// says at which wall, and where.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using Eigen::VectorXd;
using stellate::testing::BallOf;
using stellate::testing::BettiNumbers;
using stellate::testing::Domain;
using stellate::testing::HalfSpaceOf;
using stellate::testing::Make;
using stellate::testing::MeshOf;
using stellate::testing::WallMesh;

// min(f / a, g / b): the two are one wall.
Domain::Function LeastOf(Domain::Function f, double a, Domain::Function g, double b) {
  return [=](const VectorXd& x, VectorXd* gradient) {
    const double here = f(x, nullptr) / a, there = g(x, nullptr) / b;
    if (gradient) {
      (here < there ? f : g)(x, gradient);
      *gradient /= here < there ? a : b;
    }
    return std::min(here, there);
  };
}

Domain::Function ProductOf(Domain::Function f, Domain::Function g) {
  return [=](const VectorXd& x, VectorXd* gradient) {
    VectorXd of_f(x.size()), of_g(x.size());
    const double here = f(x, &of_f), there = g(x, &of_g);
    if (gradient) *gradient = here * of_g + there * of_f;
    return here * there;
  };
}

// A unit vector of R^d at random.
VectorXd DirectionOf(int d, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  return VectorXd::Zero(d).unaryExpr([&](double) { return normal(random); }).normalized();
}

// The unit ball without a smaller one, `gap` below its skin.
Domain HollowBall(int d, double radius, double gap, std::uint64_t seed) {
  std::vector<int> homology(static_cast<std::size_t>(d) + 1, 0);
  homology[0] = homology[static_cast<std::size_t>(d) - 1] = 1;
  std::vector<int> boundary(static_cast<std::size_t>(d), 0);
  boundary[0] = boundary.back() = 2;
  Domain m = Make(d, d, 1.2, homology, boundary);
  const VectorXd centre = (1 - radius - gap) * DirectionOf(d, seed);
  m.walls = {BallOf(VectorXd::Zero(d), 1, -1, d), BallOf(centre, radius, 1, d)};
  return m;
}

// S^(d-1) without two caps, of .6 and `radius`, `gap` from each other: angles.
Domain TwiceCappedSphere(int d, double radius, double gap, std::uint64_t) {
  std::vector<int> homology(static_cast<std::size_t>(d), 0);
  homology[0] = homology[static_cast<std::size_t>(d) - 2] = 1;
  std::vector<int> boundary(static_cast<std::size_t>(d) - 1, 0);
  boundary[0] = boundary.back() = 2;
  Domain m = Make(d - 1, d, 1.2, homology, boundary);
  m.equations = {BallOf(VectorXd::Zero(d), 1, 1, d)};
  const double apart = 0.6 + radius + gap;
  const VectorXd axis = VectorXd::Unit(d, d - 1);
  const VectorXd other = std::cos(apart) * axis + std::sin(apart) * VectorXd::Unit(d, 0);
  m.walls = {HalfSpaceOf(-axis, std::cos(0.6)), HalfSpaceOf(-other, std::cos(radius))};
  return m;
}

// The ball without a smaller one, all by one function.
Domain HollowBallOfOneWall(int d, double radius, double gap, std::uint64_t seed, bool product) {
  Domain m = HollowBall(d, radius, gap, seed);
  m.walls = {product ? ProductOf(m.walls[0], m.walls[1])
                     : LeastOf(m.walls[0], 1, m.walls[1], radius)};
  return m;
}

WallMesh MeshAt(const Domain& m, double epsilon, std::uint64_t seed = 1) {
  Specification spec = m.SpecificationFor(epsilon);
  spec.random_seed = seed;
  spec.limits.max_vertices = 6000;
  return MeshOf(m, spec);
}

// Whether it is certified: then with all pieces of the boundary, else for the wall and the place.
bool ExpectNothingDropped(const Domain& m, double epsilon, std::uint64_t seed, int wall) {
  SCOPED_TRACE("epsilon " + std::to_string(epsilon) + ", seed " + std::to_string(seed));
  const WallMesh mesh = MeshAt(m, epsilon, seed);
  const Certificate& c = mesh.report.certificate;
  if (c.certified) {
    EXPECT_EQ(BettiNumbers(mesh.simplices), m.homology) << c.verdict;
    EXPECT_EQ(BettiNumbers(mesh.Rim()), m.boundary_homology) << c.verdict;
    return true;
  }
  EXPECT_NE(c.verdict.find("wall " + std::to_string(wall)), std::string::npos) << c.verdict;
  EXPECT_NE(c.verdict.find("("), std::string::npos) << c.verdict;
  EXPECT_NE(c.verdict.find("epsilon"), std::string::npos) << c.verdict;
  return false;
}

TEST(WallPiecesTest, WallsBesideOthersAreNotDropped) {
  struct {
    Domain (*make)(int, double, double, std::uint64_t);
    int d;
    double epsilon;
  } const kinds[] = {{HollowBall, 3, 0.4},
                     {HollowBall, 2, 0.25},
                     {TwiceCappedSphere, 3, 0.3},
                     {TwiceCappedSphere, 4, 0.4}};
  for (const auto& [make, d, epsilon] : kinds)
    for (const double share : {0.05, 0.1, 0.2})
      for (const double gap : {0.1, 0.5}) {
        SCOPED_TRACE("in R^" + std::to_string(d) + ", a void of " + std::to_string(share) + ", " +
                     std::to_string(gap) + " from the next");
        ExpectNothingDropped(make(d, share * epsilon, gap * epsilon, 3), epsilon, 3, 1);
      }
}

TEST(WallPiecesTest, WallsBesideOthersAreMeshedWhereTheyAreLargeEnough) {
  EXPECT_TRUE(ExpectNothingDropped(HollowBall(3, 0.25, 0.1, 1), 0.2, 1, 1));
  EXPECT_TRUE(ExpectNothingDropped(HollowBall(2, 0.2, 0.05, 1), 0.12, 1, 1));
  EXPECT_TRUE(ExpectNothingDropped(TwiceCappedSphere(3, 0.3, 0.08, 1), 0.2, 1, 1));
}

// No mesh of this epsilon ends at such voids, however many rounds try.
TEST(WallPiecesTest, VoidsThatAreTooSmallEndARunSoon) {
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    const WallMesh mesh = MeshAt(HollowBall(3, 0.04, 0.2, seed), 0.4, seed);
    EXPECT_FALSE(mesh.report.certificate.certified);
    EXPECT_LT(mesh.report.counts.rounds, 200u) << seed;
  }
}

TEST(WallPiecesTest, SheetsOfOneWallAreNotDropped) {
  for (const bool product : {false, true})
    for (const double share : {0.1, 0.35, 0.5})
      for (const std::uint64_t seed : {1, 2}) {
        SCOPED_TRACE(std::string(product ? "product" : "least") + ", a void of " +
                     std::to_string(share));
        ExpectNothingDropped(HollowBallOfOneWall(3, share * 0.4, 0.4, seed, product), 0.4, seed, 0);
        if (share > 0.1 || !product)
          ExpectNothingDropped(HollowBallOfOneWall(2, share * 0.2, 0.2, seed, product), 0.2, seed,
                               0);
      }
}

// A solver that goes down from where it is finds the void from little of what is around it. Where a
// clearance tells of it, it is asked again from there.
TEST(WallPiecesTest, ClearancesTellOfSheetsThatClosestPointsPassBy) {
  for (const std::uint64_t seed : {12, 14, 22, 24, 25, 30, 35, 40})
    ExpectNothingDropped(HollowBallOfOneWall(3, 0.04, 0.4, seed, false), 0.4, seed, 0);
  // Here refinement has the clearance that tells, long before the certificate asks anything.
  for (const std::uint64_t seed : {13, 15, 26})
    ExpectNothingDropped(HollowBallOfOneWall(3, 0.02, 0.2, seed, false), 0.2, seed, 0);
}

// Nearer than two epsilons, so that a centre common to points of both is nearer than epsilon to
// each.
TEST(WallPiecesTest, SheetsOfOneWallMayBeNearToEachOther) {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6})
    for (const bool product : {false, true})
      EXPECT_TRUE(
          ExpectNothingDropped(HollowBallOfOneWall(3, 0.4, 0.3, seed, product), 0.2, seed, 0));
}

// Circles of these radii, centres on the first axis.
Domain Circles(const std::vector<double>& radii, const std::vector<Domain::Function>& walls) {
  Domain m = Make(1, 2, 2.5 * static_cast<double>(radii.size()), {}, {});
  Domain::Function all = BallOf(VectorXd::Zero(2), radii[0], 1, 2);
  for (std::size_t i = 1; i < radii.size(); ++i)
    all =
        ProductOf(all, BallOf(4.0 * static_cast<double>(i) * VectorXd::Unit(2, 0), radii[i], 1, 2));
  m.equations = {all};
  m.walls = walls;
  return m;
}

void ExpectArcs(const Domain& m, std::uint64_t pieces, std::int64_t chi, std::uint64_t ends) {
  const WallMesh mesh = MeshAt(m, 0.2);
  const Certificate& c = mesh.report.certificate;
  EXPECT_TRUE(c.certified) << c.verdict;
  EXPECT_EQ(c.components, pieces);
  EXPECT_EQ(c.euler_characteristic, chi);
  EXPECT_EQ(c.boundary_components, ends);
  EXPECT_EQ(mesh.Rim().size(), ends);
}

TEST(WallPiecesTest, CurvesHaveAnyNumberOfEnds) {
  const VectorXd x = VectorXd::Unit(2, 0);
  const auto slab = [&](double half) {
    return [half](const VectorXd& p, VectorXd* g) {
      if (g) *g = -2 * p[0] * VectorXd::Unit(2, 0);
      return half * half - p[0] * p[0];
    };
  };
  ExpectArcs(Circles({1}, {HalfSpaceOf(x, 0)}), 1, 1, 2);
  ExpectArcs(Circles({1}, {HalfSpaceOf(x, 0.5), HalfSpaceOf(-x, 0.5)}), 2, 2, 4);
  ExpectArcs(Circles({1}, {slab(0.5)}), 2, 2, 4);
  ExpectArcs(Circles({1, 1}, {HalfSpaceOf(x, 0.5)}), 2, 1, 2);  // one of two circles is cut
  ExpectArcs(Circles({1, 1}, {HalfSpaceOf(VectorXd::Unit(2, 1), 0.5)}), 2, 2, 4);
  Domain line = Make(1, 1, 1.3, {}, {});
  line.walls = {BallOf(VectorXd::Zero(1), 1, -1, 1), BallOf(VectorXd::Zero(1), 0.3, 1, 1)};
  ExpectArcs(line, 2, 2, 4);
}

TEST(WallPiecesTest, WhatNoWallCutsHasItsOwnEulerCharacteristic) {
  struct {
    int k;
    double epsilon;
    std::int64_t chi;
  } const spheres[] = {{1, 0.2, 0}, {2, 0.2, 2}, {3, 0.4, 0}};
  for (const auto& [k, epsilon, chi] : spheres) {
    Domain m = Make(k, k + 1, 1.3, {}, {});
    m.equations = {BallOf(VectorXd::Zero(k + 1), 1, 1, k + 1)};
    m.walls = {HalfSpaceOf(-VectorXd::Unit(k + 1, k), 2)};
    const Certificate c = MeshAt(m, epsilon).report.certificate;
    EXPECT_TRUE(c.certified) << c.verdict;
    EXPECT_EQ(c.euler_characteristic, chi) << "S^" << k;
    EXPECT_TRUE(c.faces.empty());
  }
  Domain torus = Make(2, 3, 1.6, {}, {});
  torus.equations = {stellate::testing::TorusOf()};
  stellate::testing::Box(torus, 2);
  const Certificate c = MeshAt(torus, 0.2).report.certificate;
  EXPECT_TRUE(c.certified) << c.verdict;
  EXPECT_EQ(c.euler_characteristic, 0);
}

// Planes that cross outside of the ball, sharply: the second cuts nothing.
TEST(WallPiecesTest, WallsMayCrossAtAnyAngleOutsideOfTheManifold) {
  for (const int d : {2, 3})
    for (const double degrees : {2.0, 5.0, 10.0})
      for (const std::uint64_t seed : {1, 2}) {
        SCOPED_TRACE("R^" + std::to_string(d) + ", " + std::to_string(degrees) + " degrees");
        const double t = degrees * std::numbers::pi / 180;
        const VectorXd x = VectorXd::Unit(d, 0), y = VectorXd::Unit(d, 1);
        Domain m = Make(d, d, 1.2, {}, {});
        m.walls = {
            HalfSpaceOf(-y, 0.2),
            HalfSpaceOf(-std::cos(t) * y - std::sin(t) * x, 0.2 * std::cos(t) + 1.3 * std::sin(t)),
            BallOf(VectorXd::Zero(d), 1, -1, d)};
        const Certificate c = MeshAt(m, 0.3, seed).report.certificate;
        EXPECT_TRUE(c.certified) << c.verdict;
        EXPECT_EQ(c.boundary_components, 1u);
      }
}

}  // namespace
}  // namespace stellate::core
