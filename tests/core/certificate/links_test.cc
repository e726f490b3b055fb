#include "core/certificate/complex/links.h"

#include <gtest/gtest.h>

#include "core/certificate/complex/fundamental_group.h"
#include "tests/core/certificate/handmade_meshes.h"

namespace stellate::core {
namespace {

LinkReport Links(const HandmadeMesh& mesh) { return CheckLinks(Adjacency(mesh.List())); }

// The suspension of a closed complex: two more vertices, whose links it becomes.
HandmadeMesh Suspend(const HandmadeMesh& mesh) {
  HandmadeMesh result;
  result.k = mesh.k + 1;
  result.d = mesh.d;
  result.points = mesh.points;
  const std::uint32_t north = mesh.vertices();
  const std::uint32_t south = north + 1;
  result.points.resize(mesh.points.size() + 2 * mesh.d, 0.0);
  for (std::size_t s = 0; s < mesh.size(); ++s) {
    const auto begin = mesh.simplices.begin() + s * (mesh.k + 1);
    for (const std::uint32_t pole : {north, south}) {
      std::vector<std::uint32_t> ids(begin, begin + mesh.k + 1);
      ids.push_back(pole);
      result.AddSimplex(ids);
    }
  }
  return result;
}

TEST(Links, SpheresAndToriPassInEveryDimensionAndAreDecidedExactly) {
  for (int k = 1; k <= 5; ++k) {
    for (const HandmadeMesh& mesh : {SimplexBoundary(k), CrossPolytope(k)}) {
      const LinkReport report = Links(mesh);
      EXPECT_EQ(report.bad_links, 0u) << k << report.first_bad_link;
      EXPECT_TRUE(report.decided_exactly) << k;
    }
  }
  for (const auto& [k, n] : {std::pair{1, 9}, {2, 7}, {3, 5}, {4, 4}}) {
    const LinkReport report = Links(TorusGrid(k, n, CliffordPoint));
    EXPECT_EQ(report.bad_links, 0u) << k << report.first_bad_link;
    EXPECT_TRUE(report.decided_exactly) << k;
  }
}

TEST(Links, APinchedVertexIsFound) {
  HandmadeMesh mesh = Icosphere(2);
  mesh.Append(Icosphere(2));
  mesh.Merge(mesh.vertices() - 1, 3);
  const Adjacency adjacency(mesh.List());
  EXPECT_EQ(adjacency.bad_facets(), 0u);
  const LinkReport report = CheckLinks(adjacency);
  EXPECT_EQ(report.bad_links, 1u);
  EXPECT_EQ(report.first_bad_link, "the link of vertex 3 falls into several parts");
}

TEST(Links, APinchedEdgeIsFound) {
  // Two 3-spheres glued along one edge: facets are all in two simplices, but the link of the edge
  // is two circles and the links of its ends are spheres glued at a point.
  HandmadeMesh mesh = CrossPolytope(3);
  const std::uint32_t shift = mesh.vertices();
  mesh.Append(CrossPolytope(3));
  mesh.Merge(shift, 0);
  mesh.Merge(shift + 2, 2);
  const Adjacency adjacency(mesh.List());
  EXPECT_EQ(adjacency.bad_facets(), 0u);
  EXPECT_EQ(CheckLinks(adjacency).bad_links, 2u);
}

TEST(Links, ASurfaceThatIsNotASphereIsNoLink) {
  for (const bool klein : {false, true}) {
    const HandmadeMesh mesh = Suspend(TorusGrid(2, 7, CliffordPoint, klein));
    const LinkReport report = Links(mesh);
    EXPECT_EQ(report.bad_links, 2u);
    EXPECT_NE(report.first_bad_link.find("Euler"), std::string::npos);
  }
}

TEST(Links, AThreeManifoldWithLoopsIsNoLink) {
  // Its Euler characteristic is that of a 3-sphere.
  const LinkReport report = Links(Suspend(TorusGrid(3, 4, CliffordPoint)));
  EXPECT_EQ(report.bad_links, 2u);
  EXPECT_NE(report.first_bad_link.find("loops"), std::string::npos);
}

TEST(Links, ADoubleSuspensionIsJudgedAtItsEdgesToo) {
  const HandmadeMesh mesh = Suspend(Suspend(TorusGrid(3, 4, CliffordPoint)));
  const LinkReport report = Links(mesh);
  // The four poles: the edges between poles of different kinds have the torus as link.
  EXPECT_EQ(report.bad_links, 4u);
}

TwoSkeleton Skeleton(const HandmadeMesh& surface) {
  TwoSkeleton skeleton;
  skeleton.vertices = surface.vertices();
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> numbers;
  for (std::size_t s = 0; s < surface.size(); ++s) {
    const std::uint32_t* t = &surface.simplices[3 * s];
    std::array<std::uint32_t, 3> sides{};
    int n = 0;
    for (const auto& e : {std::array{t[0], t[1]}, {t[0], t[2]}, {t[1], t[2]}}) {
      const auto [place, fresh] =
          numbers.try_emplace(e, static_cast<std::uint32_t>(skeleton.edges.size()));
      if (fresh) skeleton.edges.push_back(e);
      sides[n++] = place->second;
    }
    skeleton.triangles.push_back(sides);
  }
  return skeleton;
}

TEST(ClassifyLoops, TellsSurfacesApart) {
  EXPECT_EQ(ClassifyLoops(Skeleton(Icosphere(2))), LoopVerdict::kSimplyConnected);
  EXPECT_EQ(ClassifyLoops(Skeleton(TorusGrid(2, 5, CliffordPoint))), LoopVerdict::kHasHomology);
  EXPECT_EQ(ClassifyLoops(Skeleton(TorusGrid(2, 5, CliffordPoint, true))),
            LoopVerdict::kHasHomology);
}

TEST(ClassifyLoops, DoesNotCallALoopOfOrderThreeContractible) {
  // A disc whose boundary, of nine edges, goes three times round a triangle: the fundamental
  // group is Z/3, invisible over Z/2.
  TwoSkeleton skeleton;
  skeleton.vertices = 13;  // 0..2: the triangle; 3..11: a ring; 12: the disc's centre
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> numbers;
  const auto edge = [&](std::uint32_t a, std::uint32_t b) {
    const std::array<std::uint32_t, 2> key{std::min(a, b), std::max(a, b)};
    const auto [place, fresh] =
        numbers.try_emplace(key, static_cast<std::uint32_t>(skeleton.edges.size()));
    if (fresh) skeleton.edges.push_back(key);
    return place->second;
  };
  const auto triangle = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    skeleton.triangles.push_back({edge(a, b), edge(a, c), edge(b, c)});
  };
  for (std::uint32_t i = 0; i < 9; ++i) {
    const std::uint32_t next = (i + 1) % 9;
    triangle(i % 3, next % 3, 3 + i);
    triangle(next % 3, 3 + i, 3 + next);
    triangle(3 + i, 3 + next, 12);
  }
  EXPECT_EQ(ClassifyLoops(skeleton), LoopVerdict::kNoHomology);
}

}  // namespace
}  // namespace stellate::core
