// Where walls meet at small angles: told by name, with the angle and the place.

#include <gtest/gtest.h>

#include <string>

#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using stellate::testing::Domain;

Certificate CertificateOf(const Domain& m, const Specification& spec) {
  return stellate::testing::MeshOf(m, spec).report.certificate;
}

TEST(SharpWallsTest, AnUnfinishedRunNamesTheWallsTheAngleAndThePlace) {
  const Domain wedge = stellate::testing::Wedge(20);
  Specification spec = wedge.SpecificationFor(0.3);
  spec.limits.max_vertices = 60;
  const Certificate c = CertificateOf(wedge, spec);
  ASSERT_TRUE(c.sharpest);
  EXPECT_EQ(c.sharpest->walls, WallSet{3}) << "the two planes";
  EXPECT_NEAR(c.sharpest->degrees, 20, 1e-6);
  EXPECT_LT(c.sharpest->point.head(2).norm(), 1e-9) << "on the axis";
  EXPECT_FALSE(c.certified);
  EXPECT_NE(c.verdict.find("walls 0 and 1 meet at 20 degrees at ("), std::string::npos)
      << c.verdict;
}

// If protecting balls cope with the angle, it is not the angle that is to blame.
TEST(SharpWallsTest, AnAngleWithProtectingBallsIsNotBlamed) {
  const Domain wedge = stellate::testing::Wedge(40);
  Specification spec = wedge.SpecificationFor(0.3);
  spec.limits.max_vertices = 60;
  const Certificate c = CertificateOf(wedge, spec);
  EXPECT_FALSE(c.certified);
  ASSERT_TRUE(c.sharpest);
  EXPECT_EQ(c.verdict.find("degrees"), std::string::npos) << c.verdict;
}

TEST(SharpWallsTest, ACornerOfASurfaceIsNamedBelow15DegreesAlone) {
  for (const double degrees : {14.5, 25.0}) {
    const Domain lune = stellate::testing::Lune(degrees);
    const Certificate c = CertificateOf(lune, lune.SpecificationFor(0.2));
    ASSERT_TRUE(c.sharpest);
    EXPECT_NEAR(c.sharpest->degrees, degrees, 1e-6);
    std::string words = c.verdict;
    for (const std::string& warning : c.warnings) words += warning;
    EXPECT_EQ(words.find("alls 0 and 1 meet at 14.5 degrees at (") != std::string::npos,
              degrees < 15)
        << words;
  }
}

TEST(SharpWallsTest, WallsThatDoNotMeetHaveNoAngle) {
  const Domain shell = stellate::testing::Shell();
  EXPECT_FALSE(CertificateOf(shell, shell.SpecificationFor(0.3)).sharpest);
}

}  // namespace
}  // namespace stellate::core
