// The judge itself, on complexes known by heart.
#include "support/mesh_judge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace stellate::testing {
namespace {

SimplexMatrix Complex(const std::vector<std::vector<std::uint32_t>>& facets) {
  SimplexMatrix simplices(static_cast<Eigen::Index>(facets.front().size()),
                          static_cast<Eigen::Index>(facets.size()));
  for (size_t j = 0; j < facets.size(); ++j) {
    for (size_t i = 0; i < facets[j].size(); ++i) {
      simplices(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = facets[j][i];
    }
  }
  return simplices;
}

// The boundary of the n-simplex: an (n-1)-sphere.
SimplexMatrix BoundaryOfSimplex(std::uint32_t n) {
  std::vector<std::vector<std::uint32_t>> facets;
  for (std::uint32_t drop = 0; drop <= n; ++drop) {
    std::vector<std::uint32_t> facet;
    for (std::uint32_t i = 0; i <= n; ++i) {
      if (i != drop) facet.push_back(i);
    }
    facets.push_back(facet);
  }
  return Complex(facets);
}

using Numbers = std::vector<int>;

TEST(Judge, KnowsSpheresOfEveryDimension) {
  for (const std::uint32_t n : {2u, 3u, 4u, 5u}) {
    const Judgement judgement = Judge(BoundaryOfSimplex(n), n + 1);
    EXPECT_TRUE(judgement.IsClosedManifold()) << n;
    EXPECT_TRUE(judgement.orientable);
    Numbers sphere(n, 0);
    sphere.front() = sphere.back() = 1;
    EXPECT_EQ(judgement.betti_mod2, sphere);
    EXPECT_EQ(judgement.betti_mod3, sphere);
    EXPECT_EQ(judgement.euler_characteristic, n % 2 == 1 ? 2 : 0);
  }
}

TEST(Judge, KnowsMoebiusSevenVertexTorus) {
  std::vector<std::vector<std::uint32_t>> facets;
  for (std::uint32_t i = 0; i < 7; ++i) {
    for (const std::uint32_t middle : {1u, 2u}) {
      std::vector<std::uint32_t> facet = {i, (i + middle) % 7, (i + 3) % 7};
      std::sort(facet.begin(), facet.end());
      facets.push_back(facet);
    }
  }
  const Judgement judgement = Judge(Complex(facets), 7);
  EXPECT_TRUE(judgement.IsClosedManifold());
  EXPECT_TRUE(judgement.orientable);
  EXPECT_EQ(judgement.components, 1);
  EXPECT_EQ(judgement.betti_mod2, (Numbers{1, 2, 1}));
  EXPECT_EQ(judgement.betti_mod3, (Numbers{1, 2, 1}));
}

TEST(Judge, KnowsTheSixVertexProjectivePlane) {
  const SimplexMatrix plane = Complex({{0, 1, 2},
                                       {0, 1, 3},
                                       {0, 2, 4},
                                       {0, 3, 5},
                                       {0, 4, 5},
                                       {1, 2, 5},
                                       {1, 3, 4},
                                       {1, 4, 5},
                                       {2, 3, 4},
                                       {2, 3, 5}});
  const Judgement judgement = Judge(plane, 6);
  EXPECT_TRUE(judgement.IsClosedManifold());
  EXPECT_FALSE(judgement.orientable);
  EXPECT_EQ(judgement.euler_characteristic, 1);
  EXPECT_EQ(judgement.betti_mod2, (Numbers{1, 1, 1}));
  EXPECT_EQ(judgement.betti_mod3, (Numbers{1, 0, 0}));
}

TEST(Judge, SeesTwoComponents) {
  SimplexMatrix both(3, 8);
  both << BoundaryOfSimplex(3), BoundaryOfSimplex(3).array() + 4;
  const Judgement judgement = Judge(both, 8);
  EXPECT_TRUE(judgement.IsClosedManifold());
  EXPECT_EQ(judgement.components, 2);
  EXPECT_EQ(judgement.betti_mod2, (Numbers{2, 0, 2}));
}

TEST(Judge, SeesAHole) {
  const Judgement judgement = Judge(BoundaryOfSimplex(3).leftCols(3), 4);
  EXPECT_EQ(judgement.bad_faces, 3u);
  EXPECT_EQ(judgement.bad_links, 3u);
}

TEST(Judge, SeesAPinchWhereAllFacesAreGood) {
  // Two tetrahedra's boundaries with vertex 0 in common.
  SimplexMatrix pinched(3, 8);
  pinched << BoundaryOfSimplex(3), BoundaryOfSimplex(3).array() + 3;
  for (Eigen::Index j = 4; j < 8; ++j) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      if (pinched(i, j) == 3) pinched(i, j) = 0;
    }
  }
  const Judgement judgement = Judge(pinched, 7);
  EXPECT_TRUE(judgement.valid);
  EXPECT_EQ(judgement.bad_faces, 0u);
  EXPECT_EQ(judgement.bad_links, 1u);
  EXPECT_FALSE(judgement.IsClosedManifold());
}

TEST(Judge, SeesASuspendedTorusIsNoManifold) {
  // The link of each apex is a torus: closed, and no sphere.
  std::vector<std::vector<std::uint32_t>> facets;
  for (std::uint32_t i = 0; i < 7; ++i) {
    for (const std::uint32_t middle : {1u, 2u}) {
      for (const std::uint32_t apex : {7u, 8u}) {
        std::vector<std::uint32_t> facet = {i, (i + middle) % 7, (i + 3) % 7, apex};
        std::sort(facet.begin(), facet.end());
        facets.push_back(facet);
      }
    }
  }
  const Judgement judgement = Judge(Complex(facets), 9);
  EXPECT_EQ(judgement.bad_faces, 0u);
  EXPECT_EQ(judgement.bad_links, 2u);
}

TEST(Judge, RefusesNonsense) {
  EXPECT_FALSE(Judge(Complex({{0, 1, 2}}), 2).valid);             // no such vertex
  EXPECT_FALSE(Judge(Complex({{0, 2, 1}}), 3).valid);             // not ascending
  EXPECT_FALSE(Judge(Complex({{0, 1, 2}, {0, 1, 2}}), 3).valid);  // twice
  EXPECT_EQ(Judge(BoundaryOfSimplex(3), 6).unused_vertices, 2u);
}

}  // namespace
}  // namespace stellate::testing
