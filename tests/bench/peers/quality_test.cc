#include "tests/bench/peers/quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "tests/support/make_manifold.h"

// The yardstick of the comparison, compared with meshes that are known completely.

namespace stellate::bench {
namespace {

using testing::Make;
using Simplices = std::vector<std::uint32_t>;

// The vertices at plus and minus the unit vectors of R^d, padded with zeros to R^D.
Eigen::MatrixXd CrossPolytopeVertices(int d, int padded_to) {
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(padded_to, 2 * d);
  for (int i = 0; i < d; ++i) {
    points(i, 2 * i) = 1;
    points(i, 2 * i + 1) = -1;
  }
  return points;
}

// One vertex of each axis, in all ways.
Simplices CrossPolytopeFacets(int d) {
  Simplices simplices;
  for (unsigned signs = 0; signs < 1u << d; ++signs) {
    for (int i = 0; i < d; ++i) {
      simplices.push_back(static_cast<std::uint32_t>(2 * i) + (signs >> i & 1u));
    }
  }
  return simplices;
}

TEST(QualityTest, KnowsTheOctahedron) {
  const auto sphere = Make("sphere:2");
  const Quality quality =
      MeasureQuality(*sphere, CrossPolytopeVertices(3, 3), CrossPolytopeFacets(3));
  EXPECT_TRUE(quality.closed);
  EXPECT_EQ(quality.euler_characteristic, 2);
  EXPECT_NEAR(quality.min_angle_degrees, 60, 1e-9);
  EXPECT_NEAR(quality.min_fatness, std::sqrt(3) / 4, 1e-12);
  // The barycentres of its triangles are farthest inside.
  EXPECT_NEAR(quality.hausdorff, 1 - 1 / std::sqrt(3), 1e-12);
}

TEST(QualityTest, KnowsWhereAClippedOneEnds) {
  const auto sphere = Make("sphere:2");
  const Eigen::MatrixXd axes = Eigen::MatrixXd::Identity(3, 3);
  const double end = 1 / std::sqrt(3);  // of the axes' ends, along the diagonal
  const Quality cap = MeasureQuality(*sphere, axes, {0, 1, 2}, end);
  EXPECT_TRUE(cap.closed);
  EXPECT_EQ(cap.euler_characteristic, 1);
  EXPECT_NEAR(cap.hausdorff, 1 - end, 1e-12);
  EXPECT_NEAR(MeasureQuality(*sphere, axes, {0, 1, 2}, -0.3).hausdorff, end + 0.3, 1e-12);
  EXPECT_FALSE(MeasureQuality(*sphere, axes, {0, 1, 2}).closed);
  // Two that have a corner in common: four edges meet there.
  const Quality pinched =
      MeasureQuality(*sphere, CrossPolytopeVertices(3, 3).leftCols(5), {0, 2, 4, 1, 3, 4}, end);
  EXPECT_EQ(pinched.euler_characteristic, 1);
  EXPECT_FALSE(pinched.closed);
}

TEST(QualityTest, KnowsTheSixteenCell) {
  const auto sphere = Make("sphere:3");
  const Quality quality =
      MeasureQuality(*sphere, CrossPolytopeVertices(4, 4), CrossPolytopeFacets(4));
  EXPECT_TRUE(quality.closed);
  EXPECT_EQ(quality.euler_characteristic, 0);
  EXPECT_EQ(quality.min_angle_degrees, 0);
  EXPECT_NEAR(quality.min_fatness, std::sqrt(2) / 12, 1e-12);  // regular tetrahedra
  EXPECT_NEAR(quality.hausdorff, 0.5, 1e-12);
}

TEST(QualityTest, CountsWhatLiesOutsideTheManifoldsOwnCoordinates) {
  const auto sphere = Make("sphere:2");
  Eigen::MatrixXd points = CrossPolytopeVertices(3, 5);
  EXPECT_NEAR(MeasureQuality(*sphere, points, CrossPolytopeFacets(3)).hausdorff,
              1 - 1 / std::sqrt(3), 1e-12);
  points(4, 0) = 0.75;
  EXPECT_NEAR(MeasureQuality(*sphere, points, CrossPolytopeFacets(3)).hausdorff, 0.75, 1e-12);
}

TEST(QualityTest, SeesThinTriangles) {
  const auto sphere = Make("sphere:2");
  Eigen::MatrixXd points(3, 3);
  points << 0, 1, 2, 0, 1e-9, 0, 0, 0, 0;
  const Quality quality = MeasureQuality(*sphere, points, {0, 1, 2});
  EXPECT_NEAR(quality.min_angle_degrees, 1e-9 * 180 / M_PI, 1e-14);
  EXPECT_NEAR(quality.min_fatness, 1e-9 / 4, 1e-15);
}

class NotClosedTest : public ::testing::Test {
 protected:
  bool Closed(const Simplices& simplices) {
    return MeasureQuality(*sphere_, points_, simplices).closed;
  }
  std::unique_ptr<Manifold> sphere_ = Make("sphere:2");
  Eigen::MatrixXd points_ = CrossPolytopeVertices(3, 3);
  Simplices simplices_ = CrossPolytopeFacets(3);
};

TEST_F(NotClosedTest, WithAHole) {
  simplices_.resize(simplices_.size() - 3);
  EXPECT_FALSE(Closed(simplices_));
}

TEST_F(NotClosedTest, WithATriangleTwice) {
  for (int i = 0; i < 3; ++i) simplices_.push_back(simplices_[static_cast<std::size_t>(i)]);
  EXPECT_FALSE(Closed(simplices_));
}

TEST_F(NotClosedTest, WithAFin) {
  simplices_.insert(simplices_.end(), {0, 1, 2});
  EXPECT_FALSE(Closed(simplices_));
}

TEST_F(NotClosedTest, WithAVertexLeftOut) {
  points_.conservativeResize(3, 7);
  points_.col(6).setUnit(0);
  EXPECT_FALSE(Closed(simplices_));
}

TEST_F(NotClosedTest, WithAnotherTopology) {
  points_.conservativeResize(3, 12);
  points_.rightCols(6) = points_.leftCols(6);
  const Simplices first = simplices_;
  for (const std::uint32_t vertex : first) simplices_.push_back(vertex + 6);
  EXPECT_FALSE(Closed(simplices_));
}

TEST_F(NotClosedTest, WithNothingAtAll) { EXPECT_FALSE(Closed({})); }

}  // namespace
}  // namespace stellate::bench
