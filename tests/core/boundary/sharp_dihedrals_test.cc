#include "core/boundary/sharp_dihedrals.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/core/support/dihedrals.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using stellate::testing::DihedralAnglesOf;
using testing::AppendTo;
using testing::FramedPoints;
using testing::Make;
using testing::RandomSample;

double CosineOf(double degrees) { return std::cos(degrees * std::numbers::pi / 180); }

TEST(SharpDihedrals, AreAsMeasured) {
  for (const char* name : {"so3", "sphere:3:4"}) {
    const FramedPoints sample = RandomSample(*Make(name), 200, 3);
    Stars<3> stars(sample.d, 0.3, {3.0, CentreRule::kTangentSpace});
    AppendTo(&stars, sample);
    stars.Commit();
    const auto corner = [&](std::uint32_t id) {
      return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(sample.Point(id), sample.d));
    };
    int sharp = 0, blunt = 0;
    for (const double degrees : {5.0, 15.0, 40.0}) {
      for (std::uint32_t p = 0; p < stars.size(); ++p) {
        const auto& cell = stars.cell(p);
        double largest = 0;
        for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
          Stars<3>::Simplex s;
          if (!stars.SimplexOf(p, cell, v, &s)) continue;
          const double least =
              DihedralAnglesOf({corner(s[0]), corner(s[1]), corner(s[2]), corner(s[3])}).first;
          const bool is_sharp =
              HasSharpDihedral<3>(stars, p, sample.Point(p), cell, v, CosineOf(degrees), nullptr);
          EXPECT_EQ(is_sharp, least < degrees) << least;
          ++(is_sharp ? sharp : blunt);
          if (is_sharp && s[0] == p) largest = std::max(largest, cell.norm2(v));
        }
        const auto worst = WorstSharp<3>(stars, p, CosineOf(degrees), 0);
        ASSERT_EQ(worst.has_value(), largest > 0);
        if (!worst) continue;
        EXPECT_EQ(cell.norm2(*worst), largest);
        EXPECT_FALSE(
            WorstSharp<3>(stars, p, CosineOf(degrees), std::sqrt(largest) * 1.001).has_value());
      }
    }
    EXPECT_GT(sharp, 50);
    EXPECT_GT(blunt, 50);
  }
}

// Along an edge where the walls meet at 10 degrees nothing else can be asked for: a tetrahedron of
// two points on the edge, and one on each of the walls.
TEST(SharpDihedrals, AreNotThoseOfTheWalls) {
  constexpr double kAngle = 10 * std::numbers::pi / 180;
  constexpr WallSet kBoth = SetOfWall(0) | SetOfWall(1);
  const double tangent[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const double down[3] = {0, -1, 0}, up[3] = {-std::sin(kAngle), std::cos(kAngle), 0};
  for (const bool on_edge : {false, true}) {
    Stars<3> stars(3, 0.5, {3.0, CentreRule::kTangentSpace});
    const auto append = [&](double x, double y, double z, WallSet walls) {
      const double point[3] = {x, y, z};
      std::vector<double> conormals;
      ForEachWall(walls, [&](int wall) {
        conormals.insert(conormals.end(), wall == 0 ? down : up, (wall == 0 ? down : up) + 3);
      });
      stars.Add(point, tangent, Stars<3>::kNone, walls, conormals.data());
    };
    append(0, 0, 0, on_edge ? kBoth : 0);
    append(0, 0, 1, on_edge ? kBoth : 0);
    append(1, 0, 0.5, on_edge ? SetOfWall(0) : 0);
    append(std::cos(kAngle), std::sin(kAngle), 0.5, on_edge ? SetOfWall(1) : 0);
    stars.Commit();
    int found = 0;
    for (std::size_t v = 0; v < stars.cell(0).vertex_count(); ++v) {
      Stars<3>::Simplex s;
      if (!stars.SimplexOf(0, stars.cell(0), v, &s)) continue;
      ++found;
      EXPECT_EQ(HasSharpDihedral<3>(stars, 0, stars.sample().Point(0), stars.cell(0), v,
                                    CosineOf(14), nullptr),
                !on_edge);
    }
    EXPECT_EQ(found, 1);
  }
}

}  // namespace
}  // namespace stellate::core
