// Walls that bend more than a size can follow: what is refused names the wall, the place and the
// cure.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using stellate::testing::CreasedCube;
using stellate::testing::Domain;
using stellate::testing::PiercedDisc;

Certificate CertificateOf(const Domain& m, double epsilon, std::uint64_t seed = 1) {
  Specification spec = m.SpecificationFor(epsilon);
  spec.random_seed = seed;
  return stellate::testing::MeshOf(m, spec).report.certificate;
}

void ExpectWords(const Certificate& c, const std::string& words) {
  EXPECT_FALSE(c.certified);
  EXPECT_NE(c.verdict.find(words), std::string::npos) << c.verdict;
}

TEST(BentWallsTest, ACreaseIsNamedWithItsAngle) {
  for (const int d : {2, 3})
    for (const unsigned turn : {0u, 1u, 2u}) {
      const Certificate c = CertificateOf(CreasedCube(d).Turned(turn), 0.3);
      ExpectWords(c, "ertified: wall 0 bends by 90 degrees between vertices that are ");
      ExpectWords(c, "give its sides as walls of their own");
    }
}

TEST(BentWallsTest, ASmallHoleIsNamedWithTheSizeToTake) {
  for (const unsigned turn : {0u, 1u, 2u}) {
    const Certificate c = CertificateOf(PiercedDisc(0.15).Turned(turn), 0.3);
    ExpectWords(c, "ertified: wall 1 bends by ");
    ExpectWords(
        c, "if it is round, take epsilon at most 0.06, or be as fine there alone, by a size_rate;");
  }
  EXPECT_TRUE(CertificateOf(PiercedDisc(0.15), 0.06).certified) << "as it says";
}

TEST(BentWallsTest, AHoleWithRoomForOneVertexIsNamed) {
  for (const unsigned turn : {0u, 1u, 2u})
    ExpectWords(CertificateOf(PiercedDisc(0.04).Turned(turn), 0.3),
                "ertified: wall 1 has a piece at (");
  EXPECT_TRUE(CertificateOf(PiercedDisc(0.05), 0.02).certified) << "a fifth of its width";
}

// A layer a hundredth of epsilon thin, in a run that is not given the vertices that it takes.
TEST(BentWallsTest, AThinLayerIsTheFirstThingSaid) {
  Domain plate = stellate::testing::Cube();
  plate.walls[4] = stellate::testing::HalfSpaceOf(Eigen::Vector3d(0, 0, 1), 0.002);
  plate.walls[5] = stellate::testing::HalfSpaceOf(Eigen::Vector3d(0, 0, -1), 0.001);
  for (const unsigned turn : {0u, 1u}) {
    const Domain m = plate.Turned(turn);
    Specification spec = m.SpecificationFor(0.3);
    spec.limits.max_vertices = 300;
    const Certificate c = stellate::testing::MeshOf(m, spec).report.certificate;
    ExpectWords(c, "ertified: walls 4 and 5 are 0.003 apart at (");
    ExpectWords(c,
                "far less than epsilon 0.3: leave out the layer between them, or make it "
                "thicker, or take epsilon at most 0.012. The run ended as VERTEX_BUDGET");
  }
}

TEST(BentWallsTest, WhatEndsWellSaysNothing) {
  const Certificate c = CertificateOf(PiercedDisc(0.4), 0.1);
  EXPECT_TRUE(c.certified) << c.verdict;
  EXPECT_EQ(c.verdict.find(" bends by "), std::string::npos) << c.verdict;
}

// Where a round wall is meshed that coarsely, points of the solid between an arc and its chord lie
// outside of the mesh: they are asked about now and then.
TEST(BentWallsTest, PointsBetweenAnArcAndItsChordRefuseNothing) {
  for (const std::uint64_t seed : {66, 82, 90}) {
    const Certificate c = CertificateOf(stellate::testing::Ball(), 0.5, seed);
    EXPECT_TRUE(c.certified) << c.verdict;
  }
}

// The gyroid passes through corners of the box at half a width of pi / 2: beside that, four walls
// nearly meet in one point, edges are a tenth of the size asked for, and beyond it a small piece
// is left in a corner.
TEST(BentWallsTest, SolidsEndBesideTheCornersOfTheirBoxes) {
  struct {
    double half, epsilon;
    int pieces;
  } const cases[] = {{1.5, 0.3, 1}, {1.54, 0.3, 1}, {1.58, 0.4, 2}, {1.6, 0.4, 2}};
  for (const auto& [half, epsilon, pieces] : cases) {
    const Domain m = stellate::testing::GyroidSolid(half);
    const auto mesh = stellate::testing::MeshOf(m, m.SpecificationFor(epsilon));
    const Certificate& c = mesh.report.certificate;
    EXPECT_TRUE(c.certified) << half << ": " << c.verdict;
    EXPECT_EQ(stellate::testing::BettiNumbers(mesh.simplices), (std::vector{pieces, 0, 0, 0}));
    EXPECT_EQ(stellate::testing::BettiNumbers(mesh.Rim()), (std::vector{pieces, 0, pieces}));
  }
}

// Where such a run does not end, that is the likely cause, and told so.
TEST(BentWallsTest, WallsThatAllButMeetInOnePointAreNamed) {
  const auto verdict = [](const Domain& m, double epsilon) {
    Specification spec = m.SpecificationFor(epsilon);
    spec.limits.max_vertices = 150;
    return stellate::testing::MeshOf(m, spec).report.certificate.verdict;
  };
  const std::string words = " nearly meet in one point: two corners are 0.0108 apart at (";
  const std::string near = verdict(stellate::testing::GyroidSolid(1.56), 0.3);
  EXPECT_NE(near.find(words), std::string::npos) << near;
  EXPECT_NE(near.find("move one of these walls"), std::string::npos) << near;
  for (const Domain& m : {stellate::testing::Cube(), stellate::testing::GyroidSolid(1)}) {
    const std::string apart = verdict(m, 0.2);
    EXPECT_EQ(apart.find("nearly meet"), std::string::npos) << apart;
  }
}

}  // namespace
}  // namespace stellate::core
