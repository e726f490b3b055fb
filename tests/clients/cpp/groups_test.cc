#include "mesh/groups.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "stellate/mesh.h"

namespace stellate {
namespace {

// Two tetrahedra, above and below a triangle of wall 1; all else is on wall 0.
TEST(Regions, AreGroupsAndWhatLiesBetweenIsAFaceTurnedOutOfTheLowerLabel) {
  Mesh mesh;
  mesh.points.resize(3, 5);
  mesh.points << 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, -1;
  mesh.simplices.resize(4, 2);
  mesh.simplices << 0, 0, 1, 1, 2, 2, 3, 4;
  mesh.walls = {3, 3, 3, 1, 1};
  for (const bool below_is_first : {true, false}) {
    mesh.labels =
        below_is_first ? std::vector<std::uint8_t>{7, 2} : std::vector<std::uint8_t>{2, 7};
    const std::vector<client::Group> groups = client::GroupsOf(mesh);
    ASSERT_GE(groups.size(), 4u);
    EXPECT_EQ(groups[0].name, "region_2");
    EXPECT_EQ(groups[1].name, "region_7");
    EXPECT_EQ(groups[0].simplices.cols(), 1);
    EXPECT_EQ(groups[0].simplices.col(0).maxCoeff(), below_is_first ? 4u : 3u);
    EXPECT_EQ(groups[2].name, "wall_0");
    EXPECT_EQ(groups[2].simplices.cols(), 6);
    EXPECT_EQ(groups[3].name, "walls_0_1");
    const SimplexMatrix& between = groups[3].simplices;
    ASSERT_EQ(between.cols(), 1);
    const Eigen::Vector3d a = mesh.points.col(between(0, 0)), b = mesh.points.col(between(1, 0)),
                          c = mesh.points.col(between(2, 0));
    EXPECT_EQ((b - a).cross(c - a)[2] > 0, below_is_first);
    EXPECT_EQ(mesh.boundary().size(), 1u);
    EXPECT_EQ(mesh.faces(2).size(), 2u);
    const Mesh region = mesh.Region(7);
    EXPECT_EQ(region.simplices.cols(), 1);
    EXPECT_EQ(region.boundary().size(), 2u);
  }
  try {
    mesh.Region(1);
    ADD_FAILURE() << "there is no region 1";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "the mesh has no region 1; it has [2, 7]");
  }
  mesh.labels = {2, 7};
  mesh.region_names = {"", "soft \"matrix\"", "", "", "", "", "grain"};
  EXPECT_EQ(client::GroupsOf(mesh)[0].name, "soft__matrix_");
  EXPECT_EQ(client::GroupsOf(mesh)[1].name, "grain");
  EXPECT_EQ(client::GroupsOf(mesh)[3].sides, (std::vector<Sides>{{2, 7}}));
  EXPECT_EQ(client::GroupsOf(mesh)[1].label, 7);
  mesh.region_names[1] = "grain";  // not to be told apart
  EXPECT_EQ(client::GroupsOf(mesh)[0].name, "region_2");
  mesh.region_names.clear();
  mesh.labels = {4, 4};  // one region: the inside
  EXPECT_EQ(client::GroupsOf(mesh)[0].name, "inside");
  EXPECT_EQ(mesh.faces(2).size(), 1u);
}

}  // namespace
}  // namespace stellate
