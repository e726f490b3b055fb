#include "core/complex/corner_sectors.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <vector>

namespace stellate::core {
namespace {

// Outward conormals of walls that are positive on the given sides.
std::vector<double> Outward(const std::vector<Eigen::Vector3d>& inward) {
  std::vector<double> all;
  for (const Eigen::Vector3d& normal : inward)
    for (int a = 0; a < 3; ++a) all.push_back(-normal.normalized()[a]);
  return all;
}

// Seen from outside of it, too: four planes in general position leave fourteen cones.
TEST(CornerSectors, AnOctahedronsCornerHasFourteenSigns) {
  const std::vector<double> conormals =
      Outward({{-1, 1, 1}, {-1, -1, 1}, {-1, 1, -1}, {-1, -1, -1}});
  const std::vector<WallSet> around = SignsAround<3>(0b1111, conormals.data(), 0);
  EXPECT_EQ(around.size(), 14u);
  std::vector<std::int8_t> inside(16, 0);
  inside[15] = 1;
  const auto sectors = CornerSectors<3>(LabelTable(inside), 0b1111, conormals.data(), 0);
  ASSERT_EQ(sectors.size(), 1u);
  EXPECT_EQ(sectors[0].signs, 15u);
  EXPECT_EQ(sectors[0].bounds, 15u);
  EXPECT_EQ(ConeOfSector<3>(0b1111, conormals.data(), sectors[0]).rays.size(), 4u);
}

// Of three planes through a line and one across it.
TEST(CornerSectors, APencilOfPlanesLeavesSix) {
  const std::vector<double> conormals = Outward({{1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}});
  const std::vector<WallSet> around = SignsAround<3>(0b1111, conormals.data(), 0b10000);
  EXPECT_EQ(around.size(), 12u);
  for (const WallSet signs : around) {
    EXPECT_TRUE(IsSubset(0b10000, signs)) << "the other walls keep their signs";
    // Between x > 0 and y > 0 lies x + y > 0.
    if (IsSubset(0b101, signs)) {
      EXPECT_TRUE(IsSubset(0b010, signs));
    }
  }
}

// A plane that touches the octant only in its corner cuts no sector of it.
TEST(CornerSectors, AWallMayPassByASector) {
  const std::vector<double> conormals = Outward({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}});
  std::vector<std::int8_t> labels(16, 0);
  labels[0b0111] = 2;
  labels[0b1111] = 1;
  const auto sectors = CornerSectors<3>(LabelTable(labels), 0b1111, conormals.data(), 0);
  ASSERT_EQ(sectors.size(), 1u);
  EXPECT_EQ(sectors[0].signs, 0b1111u);
  EXPECT_EQ(sectors[0].bounds, 0b0111u);
}

}  // namespace
}  // namespace stellate::core
