#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "core/complex/stars.h"

namespace stellate::core {
namespace {

constexpr double kFrame[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
constexpr double kOutward[6] = {-1, 0, 0, 0, -1, 0};  // of x >= 0 and of y >= 0

// Points of the quarter of space that two walls leave, some of them on the walls and their edge.
void AppendQuarter(Stars<3>* stars, unsigned seed, int count) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int i = 0; i < count; ++i) {
    double point[3] = {uniform(random), uniform(random), uniform(random)};
    const auto walls = static_cast<WallSet>(i % 8 < 4 ? i % 8 : 0);
    for (const int wall : {0, 1})
      if ((walls & SetOfWall(wall)) != 0) point[wall] = 0;
    stars->Add(point, kFrame, Stars<3>::kNone, walls, kOutward + (walls == SetOfWall(1) ? 3 : 0));
  }
  stars->Commit();
}

// What is encroached on, by looking at every vertex of every cell.
std::optional<Stars<3>::CellVertex> WorstOfAll(const Stars<3>& stars, const double* point,
                                               WallSet walls) {
  std::optional<Stars<3>::CellVertex> worst;
  int lowest = 3 - CountWalls(walls);
  double farthest2 = 0;
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    const auto& cell = stars.cell(p);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const WallSet at = WallsAt<3>(cell, v);
      const int dimension = 3 - CountWalls(at);
      if (IsSubset(at, walls) || dimension == 0 || cell.HasFakeFacet(v) ||
          !stars.CutsVertex({p, v}, point))
        continue;
      if (dimension > lowest || (dimension == lowest && !(cell.norm2(v) > farthest2))) continue;
      if (!worst && dimension == 3 - CountWalls(walls)) continue;
      worst = Stars<3>::CellVertex{p, v};
      lowest = dimension;
      farthest2 = cell.norm2(v);
    }
  }
  return worst;
}

// The simplices of faces that a star holds: their walls and corners.
std::set<std::pair<WallSet, std::vector<std::uint32_t>>> OnFaces(const Stars<3>& stars,
                                                                 std::uint32_t p) {
  std::set<std::pair<WallSet, std::vector<std::uint32_t>>> simplices;
  const auto& cell = stars.cell(p);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const auto simplex = stars.FaceSimplexOf(p, cell, v);
    if (simplex.walls != 0 && !simplex.fake)
      simplices.insert({simplex.walls, {simplex.ids.begin(), simplex.ids.begin() + simplex.count}});
  }
  return simplices;
}

TEST(RestrictToBoundary, KnowsTheSameSimplicesOfFacesAndNoOthers) {
  Stars<3> whole(3, 0.5, {3.0, CentreRule::kTangentSpace}),
      alone(3, 0.5, {3.0, CentreRule::kTangentSpace});
  alone.RestrictToBoundary();
  std::size_t known = 0;
  for (unsigned part = 0; part < 4; ++part) {
    AppendQuarter(&whole, part, 40 << part);
    AppendQuarter(&alone, part, 40 << part);
    EXPECT_TRUE(alone.Simplices().empty());
    for (std::uint32_t p = 0; p < whole.size(); ++p) {
      if (whole.sample().walls(p) == 0) continue;
      const auto expected = OnFaces(whole, p);
      EXPECT_EQ(OnFaces(alone, p), expected);
      known += expected.size();
    }
  }
  EXPECT_GT(known, 1000u);
  alone.IncludeInterior();
  const auto change = alone.Commit();
  EXPECT_EQ(alone.Simplices(), whole.Simplices());
  EXPECT_EQ(change.added.size(), whole.Simplices().size());
  EXPECT_EQ(alone.simplex_count(), whole.simplex_count());
}

// As points come, and after the stars were rebuilt with protecting balls: only the boundary's stars
// are looked for, by how far their simplices of faces reach.
TEST(EncroachedBy, FindsTheWorstOfAllFaces) {
  int encroached = 0, free = 0;
  Stars<3> stars(3, 0.5, {3.0, CentreRule::kTangentSpace});
  for (unsigned part = 0; part < 6; ++part) {
    AppendQuarter(&stars, part, 40 << part);
    if (part == 4) {
      std::vector<double> radii2(stars.size(), 0.0);
      for (std::uint32_t p = 0; p < stars.size(); p += 7) radii2[p] = 1e-4;
      stars.SetProtectingBalls(std::move(radii2));
    }
    std::mt19937 random(100 + part);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int i = 0; i < 300; ++i) {
      const auto walls = static_cast<WallSet>(i % 3);
      double point[3] = {0.3 * uniform(random), 0.3 * uniform(random), uniform(random)};
      if (walls != 0) point[walls - 1] = 0;
      const auto got = stars.EncroachedBy(point, walls);
      const auto expected = WorstOfAll(stars, point, walls);
      ASSERT_EQ(got.has_value(), expected.has_value());
      ++(got ? encroached : free);
      if (!got) continue;
      EXPECT_EQ(got->star, expected->star);
      EXPECT_EQ(got->vertex, expected->vertex);
    }
  }
  EXPECT_GT(encroached, 100);
  EXPECT_GT(free, 100);
}

// Two walls, {z = 0} and {z = x y - 0.1}, nearly touch, and meet in the branches of a hyperbola. At
// points of both branches the conormals of each wall are nearly the same, but the edge's direction,
// by the two, is not. The stars of such points share no centre in the middle between the branches:
// the centres in each are in the direction of the edge there.
TEST(StarsOfFaces, ShareNoCentreWithAnotherBranchOfTheirEdge) {
  Stars<3> stars(3, 1, {10.0, CentreRule::kCommonCentre});
  const double points[2][3] = {{0.5, 0.2, 0}, {-0.2, -0.5, 0}};
  for (const auto& point : points) {
    const double steep = std::sqrt(1 + point[0] * point[0] + point[1] * point[1]);
    const double outward[6] = {0, 0, -1, point[1] / steep, point[0] / steep, -1 / steep};
    stars.Add(point, kFrame, Stars<3>::kNone, WallSet{3}, outward);
  }
  stars.Commit();
  for (const std::uint32_t p : {0u, 1u}) {
    const auto& cell = stars.cell(p);
    int shared = 0;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const auto simplex = stars.FaceSimplexOf(p, cell, v);
      if (simplex.walls != WallSet{3}) continue;
      shared += simplex.count == 2;
      // The walls' facets are a trillionth of the cell's size off the walls' planes.
      EXPECT_NEAR(cell.x(v)[2], 0, 1e-9) << p;
      EXPECT_NEAR(cell.x(v)[0] * points[p][1] + cell.x(v)[1] * points[p][0], 0, 1e-9) << p;
    }
    EXPECT_EQ(shared, 1) << p;
  }
}

}  // namespace
}  // namespace stellate::core
