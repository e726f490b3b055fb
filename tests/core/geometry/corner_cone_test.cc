#include "core/geometry/corner_cone.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace stellate::core {
namespace {

CornerCone<3> ConeOfRows(const std::vector<Eigen::Vector3d>& outward) {
  std::vector<double> conormals;
  for (const Eigen::Vector3d& n : outward) {
    const Eigen::Vector3d unit = n.normalized();
    conormals.insert(conormals.end(), unit.begin(), unit.end());
  }
  return ConeOf<3>(SetOfWall(static_cast<int>(outward.size())) - 1, conormals.data());
}

std::set<WallSet> EdgesOf(const CornerCone<3>& cone) {
  std::set<WallSet> edges;
  for (const auto& ray : cone.rays) edges.insert(ray.walls);
  return edges;
}

TEST(CornerConeTest, AnOctahedronsCornerHasFourEdges) {
  const CornerCone<3> cone = ConeOfRows({{1, 1, 1}, {-1, 1, 1}, {-1, -1, 1}, {1, -1, 1}});
  EXPECT_TRUE(cone.is_simple);
  EXPECT_EQ(cone.walls, WallSet{15});
  EXPECT_EQ(EdgesOf(cone), (std::set<WallSet>{3, 6, 12, 9}));
  for (const auto& ray : cone.rays) EXPECT_NEAR(ray.along.norm(), 1, 1e-12);
}

// Walls 0 to 2 bound an octant, wall 3 is the level set through its corner.
TEST(CornerConeTest, AWallThatTouchesTheCornerAloneIsNoWallOfIt) {
  const CornerCone<3> cone = ConeOfRows({{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {-1, -1, -1}});
  EXPECT_TRUE(cone.is_simple);
  EXPECT_EQ(cone.walls, WallSet{7});
  EXPECT_EQ(cone.rays.size(), 3u);
}

TEST(CornerConeTest, AWallMayCutAnEdgeOff) {
  const CornerCone<3> cone = ConeOfRows({{1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {-1, -1, -1}});
  EXPECT_TRUE(cone.is_simple);
  EXPECT_EQ(cone.walls, WallSet{15});
  EXPECT_EQ(cone.rays.size(), 4u);
}

TEST(CornerConeTest, WhatHasNoInsideIsNoCorner) {
  const CornerCone<3> point = ConeOfRows({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, -1, -1}});
  EXPECT_TRUE(point.rays.empty());
  EXPECT_FALSE(point.is_simple);
  const CornerCone<3> flat = ConeOfRows({{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}});
  EXPECT_FALSE(flat.is_simple);
}

// The third and the fourth meet the first two in the same edge.
TEST(CornerConeTest, MoreThanTwoWallsAlongAnEdgeAreNamed) {
  const CornerCone<3> cone = ConeOfRows({{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {-1, -1, 0}});
  EXPECT_FALSE(cone.is_simple);
  EXPECT_EQ(cone.crowded, WallSet{11});
}

}  // namespace
}  // namespace stellate::core
