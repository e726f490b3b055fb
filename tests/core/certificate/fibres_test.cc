#include "core/certificate/evidence/fibres.h"

#include <gtest/gtest.h>

#include "core/base/infinity.h"
#include "core/base/random.h"
#include "core/certificate/evidence/ball_grid.h"
#include "tests/core/certificate/handmade_meshes.h"

namespace stellate::core {
namespace {

std::vector<double> RandomPoints(int d, int count, double spread, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> points;
  for (int i = 0; i < d * count; ++i) points.push_back(spread * random.NearlyNormal());
  return points;
}

TEST(BallGrid, FindsWhatADirectSearchFinds) {
  for (const int d : {1, 2, 3, 4, 6, 12}) {
    for (const double size : {0.0, 0.01, 0.5, 3.0, kInfinity}) {
      const std::vector<double> centres = RandomPoints(d, 60, 1, d);
      Random random(3);
      std::vector<double> radii;
      for (int i = 0; i < 60; ++i) radii.push_back(size == 0 ? 0 : size * (0.1 + random.Uniform()));
      const BallGrid grid(d, centres.data(), radii);
      std::vector<double> queries = RandomPoints(d, 200, 1.5, d + 100);
      queries.insert(queries.end(), centres.begin(), centres.end());
      for (std::size_t q = 0; q < queries.size(); q += d) {
        std::vector<std::uint32_t> expected, found;
        for (std::uint32_t i = 0; i < 60; ++i) {
          if (SquaredDistance(&centres[i * d], &queries[q], d) < radii[i] * radii[i])
            expected.push_back(i);
        }
        grid.ForEachAround(&queries[q], [&](std::uint32_t i, double squared) {
          found.push_back(i);
          EXPECT_EQ(squared, SquaredDistance(&centres[i * d], &queries[q], d));
        });
        EXPECT_EQ(found, expected) << d << " " << size;
      }
    }
  }
}

TEST(BallGrid, MayBeEmptyOrFlat) {
  const BallGrid none(3, nullptr, {});
  const std::vector<double> point = RandomPoints(3, 1, 1, 9);
  none.ForEachAround(point.data(), [](std::uint32_t, double) { FAIL(); });
  const BallGrid one(3, point.data(), {0.5});
  int seen = 0;
  one.ForEachAround(point.data(), [&](std::uint32_t, double squared) {
    ++seen;
    EXPECT_EQ(squared, 0);
  });
  EXPECT_EQ(seen, 1);
}

TEST(FindNearestVertices, FindsTheLowestOfTheNearestHoweverFar) {
  HandmadeMesh mesh = Icosphere(3);
  mesh.Append(HandmadeMesh(mesh));  // each vertex twice
  std::vector<double> points = RandomPoints(3, 100, 0.7, 1);
  for (const double x : {100.0, -1e6, 1e9}) points.insert(points.end(), {x, 1, 2});
  for (const double near : {0.0, 1e-3, 0.1, 10.0}) {
    const std::vector<NearestVertex> found = FindNearestVertices(mesh.View(), points, near);
    ASSERT_EQ(found.size(), 103u);
    for (std::size_t i = 0; i < found.size(); ++i) {
      NearestVertex nearest{0, kInfinity};
      for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
        const double distance = Distance(&points[3 * i], mesh.View().Point(v), 3);
        if (distance < nearest.distance) nearest = {v, distance};
      }
      EXPECT_EQ(found[i].vertex, nearest.vertex) << i;
      EXPECT_EQ(found[i].distance, nearest.distance) << i;
    }
  }
  EXPECT_TRUE(FindNearestVertices(mesh.View(), {}, 1).empty());
}

// Hits of the flats through points of M with the tangent spaces there.
std::vector<FibreHits> Hits(const HandmadeMesh& mesh, const HandmadeMesh& at, double reach_out) {
  double diameter = 0;
  for (std::size_t s = 0; s < mesh.size(); ++s) {
    const std::uint32_t* ids = &mesh.simplices[s * (mesh.k + 1)];
    for (int i = 0; i <= mesh.k; ++i)
      for (int j = 0; j < i; ++j)
        diameter = std::max(diameter, (mesh.Point(ids[i]) - mesh.Point(ids[j])).norm());
  }
  std::vector<Fibre> fibres;
  for (std::uint32_t v = 0; v < at.vertices(); ++v)
    fibres.push_back({at.View().Point(v), at.View().Tangent(v), reach_out, v});
  return CountHits(mesh.View(), Adjacency(mesh.List()), diameter, fibres);
}

// The sphere seen from random points of it.
HandmadeMesh RandomSpherePoints(int k, int count) {
  HandmadeMesh points;
  const std::vector<double> x = RandomPoints(k + 1, count, 1, 5);
  for (int i = 0; i < count; ++i) {
    const Eigen::VectorXd p =
        Eigen::Map<const Eigen::VectorXd>(&x[i * (k + 1)], k + 1).normalized();
    points.AddVertex(p, Complement(p));
  }
  return points;
}

TEST(CountHits, ANormalLineMeetsASphereOnceNearbyAndTwiceInAll) {
  for (const HandmadeMesh& mesh :
       {CrossPolytope(1), Icosphere(1), Icosphere(3), CrossPolytope(3), SimplexBoundary(4)}) {
    const HandmadeMesh points = RandomSpherePoints(mesh.k, 60);
    for (const FibreHits& hits : Hits(mesh, points, 0.9)) {
      EXPECT_EQ(hits.count, 1) << mesh.k;
      EXPECT_LT(hits.distance, 0.9);
    }
    for (const FibreHits& hits : Hits(mesh, points, 2.5)) EXPECT_EQ(hits.count, 2) << mesh.k;
  }
}

TEST(CountHits, CountsEachSimplexOnce) {
  // Across a vertex of many simplices, where a flat to the side must decide.
  const HandmadeMesh mesh = TorusGrid(2, 9, CliffordPoint);
  for (const FibreHits& hits : Hits(mesh, mesh, 0.5)) EXPECT_EQ(hits.count, 1);
  HandmadeMesh twice = mesh;
  twice.Append(mesh);
  for (const FibreHits& hits : Hits(twice, mesh, 0.5)) EXPECT_EQ(hits.count, 2);
  const HandmadeMesh solid = TorusGrid(3, 7, CliffordPoint);
  for (const FibreHits& hits : Hits(solid, solid, 0.8)) EXPECT_EQ(hits.count, 1);
}

TEST(CountHits, MissesAHole) {
  HandmadeMesh mesh = Icosphere(2);
  const HandmadeMesh points = RandomSpherePoints(2, 200);
  mesh.simplices.resize(mesh.simplices.size() / 2);
  const std::vector<FibreHits> hits = Hits(mesh, points, 0.5);
  const auto met = [&](int count) {
    return std::count_if(hits.begin(), hits.end(),
                         [count](const FibreHits& h) { return h.count == count; });
  };
  EXPECT_GT(met(0), 60);
  EXPECT_LT(met(0), 140);
  EXPECT_EQ(met(1), 200 - met(0));
}

TEST(CountHits, TellsHowFarAwayTheMeshIs) {
  const HandmadeMesh mesh = Icosphere(4);
  HandmadeMesh inner = RandomSpherePoints(2, 60);
  for (double& x : inner.points) x *= 0.8;
  for (const FibreHits& hits : Hits(mesh, inner, 0.5)) {
    EXPECT_EQ(hits.count, 1);
    EXPECT_NEAR(hits.distance, 0.2, 0.005);
    EXPECT_LT(hits.simplex, mesh.size());
  }
  for (const FibreHits& hits : Hits(mesh, inner, 0.15)) EXPECT_EQ(hits.count, 0);
}

}  // namespace
}  // namespace stellate::core
