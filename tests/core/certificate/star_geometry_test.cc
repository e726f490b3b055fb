#include "core/certificate/measure/star_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "core/base/random.h"
#include "core/certificate/complex/links.h"
#include "tests/core/certificate/handmade_meshes.h"

namespace stellate::core {
namespace {

StarGeometry Measure(const HandmadeMesh& mesh) {
  return MeasureStars(mesh.View(), Adjacency(mesh.List()));
}

// A star of six triangles round vertex 0 that goes round `turns` times.
HandmadeMesh Umbrella(int turns) {
  HandmadeMesh mesh;
  const Eigen::MatrixXd plane = Eigen::MatrixXd::Identity(3, 2);
  mesh.AddVertex(Eigen::Vector3d::Zero(), plane);
  for (int i = 0; i < 6; ++i) {
    const double angle = 2 * std::numbers::pi * turns * i / 6;
    mesh.AddVertex(Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.01 * i), plane);
  }
  for (std::uint32_t i = 0; i < 6; ++i) mesh.AddSimplex({0, 1 + i, 1 + (i + 1) % 6});
  return mesh;
}

TEST(MeasureStars, GoodMeshesAreEmbeddedInEveryDimension) {
  for (int k = 1; k <= 5; ++k) {
    EXPECT_EQ(Measure(SimplexBoundary(k)).unembedded_stars, 0u) << k;
  }
  for (const auto& [k, n] : {std::pair{1, 9}, {2, 9}, {3, 8}, {4, 6}}) {
    const StarGeometry stars = Measure(TorusGrid(k, n, CliffordPoint));
    EXPECT_EQ(stars.unembedded_stars, 0u) << k << stars.first_unembedded;
  }
}

TEST(MeasureStars, AnOrientationMakesNoDifference) {
  for (HandmadeMesh mesh :
       {SimplexBoundary(1), Icosphere(2), TorusGrid(2, 9, CliffordPoint),
        TorusGrid(3, 8, CliffordPoint), SimplexBoundary(4), SimplexBoundary(5)}) {
    Random random(5);
    std::uint64_t most = 0;
    for (const double by : {0.0, 0.1, 0.2, 0.4}) {
      for (double& x : mesh.points) x += by * random.NearlyNormal();
      const Adjacency adjacency(mesh.List());
      const Connectivity connectivity = ComputeConnectivity(adjacency);
      ASSERT_EQ(connectivity.orientation.size(), mesh.size());
      const StarGeometry by_facets = MeasureStars(mesh.View(), adjacency);
      const StarGeometry by_orientation =
          MeasureStars(mesh.View(), adjacency, connectivity.orientation);
      EXPECT_EQ(by_facets.unembedded_stars, by_orientation.unembedded_stars);
      EXPECT_EQ(by_facets.first_unembedded, by_orientation.first_unembedded);
      most = std::max(most, by_facets.unembedded_stars);
      EXPECT_TRUE(by > 0 || most == 0);
    }
    EXPECT_TRUE(most > 0 || mesh.k == 1);
  }
}

// What MeasureIfEmbedded says is what is found by neighbours.
void ExpectTheSame(const HandmadeMesh& mesh) {
  const Adjacency adjacency(mesh.List());
  const Connectivity connectivity = ComputeConnectivity(adjacency);
  const LinkReport links = CheckLinks(adjacency);
  const StarGeometry stars = MeasureStars(mesh.View(), adjacency, connectivity.orientation);
  const std::optional<EmbeddedStars> embedded =
      MeasureIfEmbedded(mesh.View(), VertexStars(mesh.List()));
  const bool good = adjacency.bad_facets() == 0 && links.bad_links == 0 &&
                    connectivity.isolated_vertices == 0 && stars.unembedded_stars == 0;
  ASSERT_EQ(embedded.has_value(), good);
  if (!good) return;
  EXPECT_EQ(embedded->connectivity.components, connectivity.components);
  EXPECT_EQ(embedded->connectivity.orientable, connectivity.orientable);
  EXPECT_EQ(embedded->euler_characteristic, links.euler_characteristic);
  EXPECT_EQ(embedded->geometry.reach, stars.reach);
  EXPECT_EQ(embedded->geometry.longest_edge, stars.longest_edge);
  EXPECT_EQ(embedded->geometry.shape.max_circumradius, stars.shape.max_circumradius);
  EXPECT_EQ(embedded->geometry.shape.largest, stars.shape.largest);
  EXPECT_EQ(embedded->geometry.shape.min_fatness, stars.shape.min_fatness);
  EXPECT_EQ(embedded->geometry.shape.max_tangent_angle_degrees,
            stars.shape.max_tangent_angle_degrees);
}

// Two meshes side by side, and the second's vertices put in place of some of the first's.
HandmadeMesh Joined(const HandmadeMesh& a, const HandmadeMesh& b, std::uint32_t shared) {
  HandmadeMesh both = a;
  for (std::uint32_t v = shared; v < b.vertices(); ++v)
    both.AddVertex(b.Point(v), Eigen::Map<const Eigen::MatrixXd>(b.View().Tangent(v), b.d, b.k));
  for (std::uint32_t id : b.simplices) {
    id = id < shared ? id : id - shared + a.vertices();
    both.simplices.push_back(id);
  }
  return both;
}

TEST(MeasureIfEmbedded, SaysWhatNeighboursSay) {
  for (const HandmadeMesh& mesh :
       {SimplexBoundary(1), TorusGrid(1, 9, CliffordPoint), SimplexBoundary(2), Icosphere(2),
        TorusGrid(2, 9, CliffordPoint), SimplexBoundary(3), TorusGrid(3, 8, CliffordPoint)}) {
    ASSERT_TRUE(MeasureIfEmbedded(mesh.View(), VertexStars(mesh.List())).has_value()) << mesh.k;
    ExpectTheSame(mesh);
    ExpectTheSame(Joined(mesh, mesh, 0));
    ExpectTheSame(Joined(mesh, mesh, 1));
    ExpectTheSame(Joined(mesh, mesh, 2));
    HandmadeMesh shaken = mesh;
    Random random(3);
    for (double& x : shaken.points) x += 0.3 * random.NearlyNormal();
    ExpectTheSame(shaken);
    HandmadeMesh open = mesh, doubled = mesh, crossed = mesh;
    const auto corners = static_cast<std::ptrdiff_t>(mesh.k) + 1;
    open.simplices.erase(open.simplices.end() - corners, open.simplices.end());
    ExpectTheSame(open);
    doubled.simplices.insert(doubled.simplices.end(), mesh.simplices.begin(),
                             mesh.simplices.begin() + corners);
    ExpectTheSame(doubled);
    std::swap_ranges(&crossed.points[0], &crossed.points[static_cast<std::size_t>(mesh.d)],
                     &crossed.points[static_cast<std::size_t>(mesh.d)]);
    ExpectTheSame(crossed);
  }
}

TEST(MeasureStars, AStarThatGoesRoundTwiceIsNotEmbedded) {
  // Only the rim's vertices have a boundary.
  EXPECT_EQ(Measure(Umbrella(1)).first_unembedded, "the star of vertex 1 has a boundary");
  EXPECT_EQ(Measure(Umbrella(2)).first_unembedded,
            "the star of vertex 0 covers some directions of its tangent space more than once");
}

TEST(MeasureStars, AFoldedStarIsNotEmbedded) {
  HandmadeMesh mesh = Umbrella(1);
  std::swap_ranges(&mesh.points[3], &mesh.points[6], &mesh.points[6]);
  EXPECT_EQ(Measure(mesh).first_unembedded,
            "the star of vertex 0 folds over itself in its tangent space");
}

TEST(MeasureStars, AStarSeenEdgeOnIsNotEmbedded) {
  HandmadeMesh mesh = SimplexBoundary(2);
  // The tangent plane of vertex 0 turned to hold its normal and one of its triangles' edges.
  const Eigen::Vector3d normal = mesh.Point(0);
  const Eigen::Vector3d along = Eigen::Vector3d(mesh.Point(1) - mesh.Point(0));
  const Eigen::Vector3d other = normal.cross(along).normalized();
  for (int i = 0; i < 3; ++i) {
    mesh.tangents[i] = normal[i];
    mesh.tangents[3 + i] = other[i];
  }
  EXPECT_EQ(Measure(mesh).unembedded_stars, 1u);
}

TEST(MeasureStars, TheReachOfAUnitSphereIsOne) {
  for (int k = 1; k <= 5; ++k) EXPECT_NEAR(Measure(SimplexBoundary(k)).reach, 1, 1e-12) << k;
  EXPECT_NEAR(Measure(Icosphere(4)).reach, 1, 1e-9);
}

TEST(MeasureStars, KnowsTheLongestEdges) {
  for (const double edge : Measure(CrossPolytope(2)).longest_edge) {
    EXPECT_NEAR(edge, std::sqrt(2.0), 1e-14);
  }
}

}  // namespace
}  // namespace stellate::core
