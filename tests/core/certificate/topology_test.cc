#include "core/certificate/complex/topology.h"

#include <gtest/gtest.h>

#include "core/certificate/complex/links.h"
#include "tests/core/certificate/handmade_meshes.h"

namespace stellate::core {
namespace {

HandmadeMesh KleinBottle(int n) { return TorusGrid(2, n, CliffordPoint, true); }

std::int64_t Euler(const HandmadeMesh& mesh) {
  return CheckLinks(Adjacency(mesh.List())).euler_characteristic;
}

TEST(Adjacency, NeighboursAcrossFacetsFindEachOther) {
  const HandmadeMesh mesh = TorusGrid(3, 4, CliffordPoint);
  const Adjacency adjacency(mesh.List());
  EXPECT_EQ(adjacency.bad_facets(), 0u);
  EXPECT_EQ(adjacency.facets(), 2 * mesh.size());
  for (std::uint32_t s = 0; s < mesh.size(); ++s) {
    for (int i = 0; i <= 3; ++i) {
      const std::uint32_t t = adjacency.Across(s, i);
      ASSERT_NE(t, Adjacency::kNone);
      int back = 0;
      for (int j = 0; j <= 3; ++j) back += adjacency.Across(t, j) == s;
      EXPECT_EQ(back, 1);
      EXPECT_FALSE(
          std::binary_search(adjacency.list()[t], adjacency.list()[t] + 4, adjacency.list()[s][i]));
    }
  }
}

TEST(Adjacency, TwoCopiesOfASimplexBoundNothing) {
  HandmadeMesh mesh = CrossPolytope(2);
  mesh.simplices.resize(3);
  mesh.AddSimplex({mesh.simplices[0], mesh.simplices[1], mesh.simplices[2]});
  const Adjacency adjacency(mesh.List());
  EXPECT_EQ(adjacency.bad_facets(), 3u);
  EXPECT_NE(adjacency.first_bad_facet().find("the same"), std::string::npos);
}

TEST(Adjacency, CountsFacetsOfThreeSimplices) {
  HandmadeMesh mesh = CrossPolytope(2);
  mesh.AddSimplex({0, 1, 2});  // shares (0 2) and (1 2) with two triangles each
  const Adjacency adjacency(mesh.List());
  EXPECT_EQ(adjacency.bad_facets(), 3u);
  EXPECT_EQ(adjacency.first_bad_facet(), "face (0 1) is in 1 simplex");
}

TEST(CheckSimplexList, RefusesBadIds) {
  HandmadeMesh mesh = CrossPolytope(2);
  EXPECT_EQ(CheckSimplexList(mesh.List()), "");
  HandmadeMesh swapped = mesh;
  std::swap(swapped.simplices[0], swapped.simplices[1]);
  EXPECT_NE(CheckSimplexList(swapped.List()), "");
  HandmadeMesh ragged = mesh;
  ragged.simplices.pop_back();
  EXPECT_NE(CheckSimplexList(ragged.List()), "");
  HandmadeMesh repeated = mesh;
  repeated.simplices[1] = repeated.simplices[0];
  EXPECT_NE(CheckSimplexList(repeated.List()), "");
}

TEST(Connectivity, CountsComponentsAndIsolatedVertices) {
  HandmadeMesh mesh = Icosphere(1);
  mesh.Append(CrossPolytope(2));
  mesh.AddVertex(Eigen::Vector3d::UnitX(), Complement(Eigen::Vector3d::UnitX()));
  const Connectivity c = ComputeConnectivity(Adjacency(mesh.List()));
  EXPECT_EQ(c.components, 2u);
  EXPECT_EQ(c.isolated_vertices, 1u);
  EXPECT_EQ(c.some_isolated, std::vector{mesh.vertices() - 1});
  EXPECT_TRUE(c.orientable);
  EXPECT_EQ(Euler(mesh), 4);
}

TEST(Connectivity, PartsThatMeetInAVertexAreOneComponent) {
  HandmadeMesh mesh = CrossPolytope(2);
  mesh.Append(CrossPolytope(2));
  mesh.Append(CrossPolytope(2));
  mesh.Merge(6, 0);
  const Connectivity c = ComputeConnectivity(Adjacency(mesh.List()));
  EXPECT_EQ(c.components, 2u);
  EXPECT_EQ(c.isolated_vertices, 1u);
  EXPECT_TRUE(c.orientable);
}

TEST(Connectivity, OrientsNeighboursAlike) {
  EXPECT_TRUE(ComputeConnectivity(Adjacency(KleinBottle(7).List())).orientation.empty());
  for (const HandmadeMesh& mesh : {SimplexBoundary(1), Icosphere(1), TorusGrid(3, 5, CliffordPoint),
                                   CrossPolytope(4), CrossPolytope(5)}) {
    const Adjacency adjacency(mesh.List());
    const Connectivity c = ComputeConnectivity(adjacency);
    ASSERT_EQ(c.orientation.size(), mesh.size());
    for (std::uint32_t s = 0; s < mesh.size(); ++s) {
      EXPECT_EQ(std::abs(c.orientation[s]), 1);
      for (int i = 0; i <= mesh.k; ++i) {
        const std::uint32_t t = adjacency.Across(s, i);
        const int j = adjacency.Apex(s, t);
        const std::uint32_t* ids = mesh.List()[s];
        EXPECT_EQ(std::find(ids, ids + mesh.k + 1, mesh.List()[t][j]), ids + mesh.k + 1);
        // The shared facet gets opposite orientations from its two sides.
        EXPECT_EQ(c.orientation[s] * (i % 2 == 0 ? 1 : -1),
                  -c.orientation[t] * (j % 2 == 0 ? 1 : -1));
      }
    }
  }
}

TEST(Connectivity, TellsOrientableFromNonOrientable) {
  EXPECT_TRUE(ComputeConnectivity(Adjacency(TorusGrid(2, 7, CliffordPoint).List())).orientable);
  EXPECT_FALSE(ComputeConnectivity(Adjacency(KleinBottle(7).List())).orientable);
  EXPECT_TRUE(ComputeConnectivity(Adjacency(TorusGrid(3, 5, CliffordPoint).List())).orientable);
  for (int k = 1; k <= 5; ++k) {
    EXPECT_TRUE(ComputeConnectivity(Adjacency(SimplexBoundary(k).List())).orientable) << k;
    EXPECT_TRUE(ComputeConnectivity(Adjacency(CrossPolytope(k).List())).orientable) << k;
  }
}

TEST(Links, EulerCharacteristicsAreRightInEveryDimension) {
  for (int k = 1; k <= 5; ++k) {
    const std::int64_t sphere = k % 2 == 0 ? 2 : 0;
    EXPECT_EQ(Euler(SimplexBoundary(k)), sphere) << k;
    EXPECT_EQ(Euler(CrossPolytope(k)), sphere) << k;
  }
  for (const auto& [k, n] : {std::pair{1, 9}, {2, 7}, {3, 5}, {4, 4}}) {
    EXPECT_EQ(Euler(TorusGrid(k, n, CliffordPoint)), 0) << k;
  }
  EXPECT_EQ(Euler(KleinBottle(7)), 0);
}

TEST(Links, EulerCharacteristicCountsFacesOfOpenComplexesToo) {
  for (int k = 1; k <= 5; ++k) {
    // A ball: the sphere without one simplex.
    HandmadeMesh mesh = CrossPolytope(k);
    mesh.RemoveSimplex(0);
    EXPECT_EQ(Euler(mesh), 1) << k;
  }
}

}  // namespace
}  // namespace stellate::core
