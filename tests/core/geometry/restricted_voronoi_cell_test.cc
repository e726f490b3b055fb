#include "core/geometry/restricted_voronoi_cell.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <map>
#include <set>
#include <type_traits>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/draft_polygon.h"
#include "tests/core/support/cells.h"
#include "tests/core/support/half_spaces.h"

namespace stellate::core {
namespace {

using testing::BruteForceVertices;
using testing::Canonical;
using testing::CombinatoricsHold;
using testing::Cube;
using testing::FakeHalfSpaces;
using testing::GivenHalfSpaces;
using testing::Grid;
using testing::HalfSpaces;
using testing::RandomHalfSpaces;
using testing::Shuffle;
using testing::Vec;
using testing::Vertices;
using testing::Weight;

template <int K>
RestrictedVoronoiCell<K> Cell(const HalfSpaces<K>& half_spaces, double inradius = 10) {
  RestrictedVoronoiCell<K> cell;
  GivenHalfSpaces<K> given(inradius);
  cell.Reset(inradius, given);
  for (const auto& h : half_spaces) given.Clip(cell, h.id, h.normal.data(), h.offset);
  return cell;
}

// Where a vertex is.
template <int K>
Vec<K> Place(const RestrictedVoronoiCell<K>& cell, std::size_t v) {
  return Eigen::Map<const Vec<K>>(cell.x(v));
}

template <int K>
Vertices<K> VerticesOf(const RestrictedVoronoiCell<K>& cell) {
  Vertices<K> all;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    std::vector<std::uint32_t> ids;
    for (int s = 0; s < K; ++s) ids.push_back(cell.id(cell.facet(v, s)));
    std::sort(ids.begin(), ids.end());
    all[ids] = Place<K>(cell, v);
  }
  return all;
}

// An orthogonal matrix.
Eigen::MatrixXd RandomTurn(int k, Random& random) {
  Eigen::MatrixXd m(k, k);
  for (int i = 0; i < k * k; ++i) m(i) = random.NearlyNormal();
  return Eigen::HouseholderQR<Eigen::MatrixXd>(m).householderQ();
}

template <typename Dimension>
class RestrictedVoronoiCellTest : public ::testing::Test {};

using Dimensions = ::testing::Types<std::integral_constant<int, 1>, std::integral_constant<int, 2>,
                                    std::integral_constant<int, 3>, std::integral_constant<int, 4>,
                                    std::integral_constant<int, 5>>;
TYPED_TEST_SUITE(RestrictedVoronoiCellTest, Dimensions);

TYPED_TEST(RestrictedVoronoiCellTest, BeginsAsARegularSimplexOfFakeFacets) {
  constexpr int K = TypeParam::value;
  RestrictedVoronoiCell<K> cell;
  cell.Reset(0.25, GivenHalfSpaces<K>(0.25));
  EXPECT_TRUE(CombinatoricsHold(cell));
  EXPECT_EQ(cell.vertex_count(), K + 1u);
  EXPECT_FALSE(cell.bounded());
  for (std::size_t f = 0; f < cell.facet_count(); ++f) EXPECT_TRUE(IsFake(cell.id(f)));
  for (const auto& h : FakeHalfSpaces<K>(0.25))
    EXPECT_NEAR(h.offset / h.normal.norm(), 0.25, 1e-14);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    EXPECT_TRUE(cell.HasFakeFacet(v));
    EXPECT_NEAR(cell.norm2(v), 0.0625 * K * K, 1e-14);
    for (std::size_t w = 0; w < cell.vertex_count(); ++w)
      EXPECT_NEAR(Place<K>(cell, v).dot(Place<K>(cell, w)), v == w ? 0.0625 * K * K : -0.0625 * K,
                  1e-14);
  }
  // Each vertex is on the borders of its facets.
  const HalfSpaces<K> fake = FakeHalfSpaces<K>(0.25);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    for (int s = 0; s < K; ++s) {
      const auto& h = fake[cell.id(cell.facet(v, s)) - kFirstFakeId];
      EXPECT_NEAR(h.normal.dot(Place<K>(cell, v)), h.offset, 1e-14);
    }
  }
}

TYPED_TEST(RestrictedVoronoiCellTest, IsTheCube) {
  constexpr int K = TypeParam::value;
  const auto cell = Cell<K>(Cube<K>());
  EXPECT_TRUE(CombinatoricsHold(cell));
  EXPECT_TRUE(cell.bounded());
  EXPECT_EQ(cell.facet_count(), 2u * K);
  EXPECT_EQ(cell.vertex_count(), 1u << K);
  EXPECT_EQ(cell.max_norm2(), K);
  std::set<std::vector<double>> corners;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    EXPECT_FALSE(cell.HasFakeFacet(v));
    for (int a = 0; a < K; ++a) EXPECT_EQ(std::abs(cell.x(v)[a]), 1);
    corners.emplace(cell.x(v), cell.x(v) + K);
  }
  EXPECT_EQ(corners.size(), 1u << K);
}

// Where K > 2 more than K facets meet at each corner: weights split a corner into several vertices,
// but they stay in its place.
TYPED_TEST(RestrictedVoronoiCellTest, IsTheCrossPolytope) {
  constexpr int K = TypeParam::value;
  HalfSpaces<K> facets;
  for (std::uint32_t signs = 0; signs < (1u << K); ++signs) {
    Vec<K> normal;
    for (int a = 0; a < K; ++a) normal[a] = signs >> a & 1 ? 1 : -1;
    facets.push_back({signs, normal, 1 - Weight(signs)});
  }
  const auto cell = Cell<K>(facets);
  EXPECT_TRUE(CombinatoricsHold(cell));
  EXPECT_TRUE(cell.bounded());
  EXPECT_EQ(cell.facet_count(), 1u << K);
  std::set<std::pair<int, bool>> corners;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const Vec<K> x = Place<K>(cell, v);
    Eigen::Index axis;
    EXPECT_NEAR(x.cwiseAbs().maxCoeff(&axis), 1, 1e-8);
    EXPECT_NEAR(x.norm(), 1, 1e-8);
    corners.emplace(static_cast<int>(axis), x[axis] > 0);
  }
  EXPECT_EQ(corners.size(), 2u * K);
}

TYPED_TEST(RestrictedVoronoiCellTest, HasTheVerticesOfRandomHalfSpaces) {
  constexpr int K = TypeParam::value;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    const int count = K <= 3 ? 30 : K == 4 ? 24 : 18;
    HalfSpaces<K> half_spaces = RandomHalfSpaces<K>(count, seed);
    const auto cell = Cell<K>(half_spaces, 2);
    EXPECT_TRUE(CombinatoricsHold(cell)) << "seed " << seed;
    const HalfSpaces<K> fake = FakeHalfSpaces<K>(2);
    half_spaces.insert(half_spaces.end(), fake.begin(), fake.end());
    const Vertices<K> expected = BruteForceVertices<K>(half_spaces), got = VerticesOf<K>(cell);
    ASSERT_EQ(got.size(), expected.size()) << "seed " << seed;
    double farthest2 = 0;
    bool any_fake = false;
    for (const auto& [ids, x] : expected) {
      const auto at = got.find(ids);
      ASSERT_NE(at, got.end()) << "seed " << seed;
      EXPECT_LT((at->second - x).norm(), 1e-9 * (1 + x.norm())) << "seed " << seed;
      farthest2 = std::max(farthest2, x.squaredNorm());
      any_fake = any_fake || IsFake(ids.back());
    }
    EXPECT_NEAR(cell.max_norm2(), farthest2, 1e-9 * farthest2);
    EXPECT_EQ(cell.bounded(), !any_fake);
  }
}

TYPED_TEST(RestrictedVoronoiCellTest, DoesNotDependOnTheOrderOfTheCuts) {
  constexpr int K = TypeParam::value;
  for (const std::uint64_t seed : {11, 12, 13}) {
    HalfSpaces<K> half_spaces = RandomHalfSpaces<K>(40, seed);
    const auto first = Canonical(Cell<K>(half_spaces, 3));
    for (std::uint64_t order = 1; order <= 5; ++order) {
      Shuffle(&half_spaces, order);
      EXPECT_EQ(Canonical(Cell<K>(half_spaces, 3)), first) << "seed " << seed << " " << order;
    }
  }
}

TYPED_TEST(RestrictedVoronoiCellTest, SaysBeforehandWhetherItWouldBeCut) {
  constexpr int K = TypeParam::value;
  RestrictedVoronoiCell<K> cell;
  GivenHalfSpaces<K> given(2);
  cell.Reset(2, given);
  int cuts = 0, misses = 0;
  for (const auto& h : RandomHalfSpaces<K>(150, 21)) {
    const auto before = Canonical(cell);
    const bool would = cell.WouldCut(h.normal.data(), h.offset);
    const bool did = given.Clip(cell, h.id, h.normal.data(), h.offset);
    EXPECT_EQ(would, did);
    EXPECT_EQ(Canonical(cell) != before, did);
    EXPECT_FALSE(cell.WouldCut(h.normal.data(), h.offset + 1e-9));
    ++(did ? cuts : misses);
  }
  EXPECT_GT(cuts, 0);
  EXPECT_GT(misses, 0);
}

TYPED_TEST(RestrictedVoronoiCellTest, OfAGridPointIsACubeWhicheverNeighbourComesFirst) {
  constexpr int K = TypeParam::value;
  HalfSpaces<K> neighbours = Grid<K>(true);
  const auto first = Canonical(Cell<K>(neighbours));
  for (std::uint64_t order = 1; order <= 4; ++order) {
    Shuffle(&neighbours, order);
    const auto cell = Cell<K>(neighbours);
    EXPECT_EQ(Canonical(cell), first) << "order " << order;
    EXPECT_TRUE(CombinatoricsHold(cell));
    EXPECT_TRUE(cell.bounded());
    std::set<std::vector<bool>> corners;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      std::vector<bool> corner;
      for (const double x : Place<K>(cell, v)) {
        EXPECT_NEAR(std::abs(x), 0.5, 1e-9);
        corner.push_back(x > 0);
      }
      corners.insert(corner);
    }
    EXPECT_EQ(corners.size(), 1u << K);
    EXPECT_NEAR(cell.max_norm2(), 0.25 * K, 1e-9);
  }
}

TYPED_TEST(RestrictedVoronoiCellTest, OfATurnedGridPointIsATurnedCube) {
  constexpr int K = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Random random(seed, 31);
    const Eigen::MatrixXd turn = RandomTurn(K, random);
    HalfSpaces<K> neighbours = Grid<K>(true);
    for (auto& h : neighbours) h.normal = turn * h.normal;
    Shuffle(&neighbours, seed);
    const auto cell = Cell<K>(neighbours);
    EXPECT_TRUE(CombinatoricsHold(cell)) << "seed " << seed;
    EXPECT_TRUE(cell.bounded());
    EXPECT_NEAR(cell.max_norm2(), 0.25 * K, 1e-9);
    std::set<std::vector<bool>> corners;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const Vec<K> x = turn.transpose() * Place<K>(cell, v);
      std::vector<bool> corner;
      for (int a = 0; a < K; ++a) {
        EXPECT_NEAR(std::abs(x[a]), 0.5, 1e-9) << "seed " << seed;
        corner.push_back(x[a] > 0);
      }
      corners.insert(corner);
    }
    EXPECT_EQ(corners.size(), 1u << K) << "seed " << seed;
  }
}

// Duplicate sample points, told apart by their weights.
TYPED_TEST(RestrictedVoronoiCellTest, IsHardlyChangedByTheSameHalfSpaceTwice) {
  constexpr int K = TypeParam::value;
  const HalfSpaces<K> once = RandomHalfSpaces<K>(25, 41);
  HalfSpaces<K> twice = once;
  for (const auto& h : once)
    twice.push_back({h.id + 1, h.normal, h.offset + Weight(h.id) - Weight(h.id + 1)});
  const auto expected = Cell<K>(once, 2), got = Cell<K>(twice, 2);
  EXPECT_TRUE(CombinatoricsHold(got));
  EXPECT_EQ(got.vertex_count(), expected.vertex_count());
  for (std::size_t v = 0; v < expected.vertex_count(); ++v) {
    double nearest = INFINITY;
    for (std::size_t w = 0; w < got.vertex_count(); ++w)
      nearest = std::min(nearest, (Place<K>(expected, v) - Place<K>(got, w)).norm());
    EXPECT_LT(nearest, 1e-6);
  }
}

// Without weights rounding decides what only touches, and may decide against itself: then the cut
// is refused, and a cell is never lost.
TYPED_TEST(RestrictedVoronoiCellTest, IsLeftAsItWasByACutThatIsRefused) {
  constexpr int K = TypeParam::value;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    Random random(seed, 31);
    const Eigen::MatrixXd turn = RandomTurn(K, random);
    HalfSpaces<K> neighbours = Grid<K>(false);
    Shuffle(&neighbours, seed);
    RestrictedVoronoiCell<K> cell;
    GivenHalfSpaces<K> given(10);
    cell.Reset(10, given);
    for (const auto& h : neighbours) {
      const auto before = Canonical(cell);
      const Vec<K> normal = turn * h.normal;
      if (!given.Clip(cell, h.id, normal.data(), h.offset)) {
        ASSERT_EQ(Canonical(cell), before) << "seed " << seed;
      }
      ASSERT_GT(cell.vertex_count(), static_cast<std::size_t>(K)) << "seed " << seed;
    }
  }
}

TYPED_TEST(RestrictedVoronoiCellTest, KeepsTheNearerOfTwoParallelHalfSpaces) {
  constexpr int K = TypeParam::value;
  RestrictedVoronoiCell<K> cell;
  GivenHalfSpaces<K> given(10);
  cell.Reset(10, given);
  for (const auto& h : Cube<K>()) given.Clip(cell, h.id, h.normal.data(), h.offset);
  const Vec<K> normal = 3 * Vec<K>::Unit(0);
  EXPECT_FALSE(given.Clip(cell, 100, normal.data(), 3.0));  // the very same plane
  EXPECT_FALSE(given.Clip(cell, 101, normal.data(), 3.5));
  EXPECT_TRUE(given.Clip(cell, 102, normal.data(), 1.5));
  EXPECT_TRUE(CombinatoricsHold(cell));
  EXPECT_EQ(cell.vertex_count(), 1u << K);
  std::set<std::uint32_t> ids;
  for (std::size_t f = 0; f < cell.facet_count(); ++f) ids.insert(cell.id(f));
  EXPECT_TRUE(ids.contains(102));
  EXPECT_FALSE(ids.contains(1));  // e_0 . x <= 1 of the cube
  EXPECT_EQ(ids.size(), 2u * K);
}

TYPED_TEST(RestrictedVoronoiCellTest, RefusesToBeCutAwayWhole) {
  constexpr int K = TypeParam::value;
  auto cell = Cell<K>(Cube<K>());
  const auto before = Canonical(cell);
  GivenHalfSpaces<K> given(10);
  const Vec<K> normal = Vec<K>::Unit(0);
  EXPECT_FALSE(given.Clip(cell, 100, normal.data(), -2));
  EXPECT_EQ(Canonical(cell), before);
}

// Whether many vertices or few, and whether what is copied to had many or few.
TYPED_TEST(RestrictedVoronoiCellTest, IsCopiedWhole) {
  constexpr int K = TypeParam::value;
  std::vector<RestrictedVoronoiCell<K>> cells;
  cells.push_back(Cell<K>(Cube<K>()));
  for (const int count : {5, 40, 300}) cells.push_back(Cell<K>(RandomHalfSpaces<K>(count, 61), 2));
  if (K == 2) {
    EXPECT_GT(cells.back().vertex_count(), 8u);
  }
  for (const auto& from : cells) {
    const RestrictedVoronoiCell<K> made(from);
    EXPECT_EQ(Canonical(made), Canonical(from));
    for (const auto& to : cells) {
      RestrictedVoronoiCell<K> copy(to);
      copy = from;
      EXPECT_EQ(Canonical(copy), Canonical(from));
      EXPECT_TRUE(CombinatoricsHold(copy));
      const RestrictedVoronoiCell<K> moved(std::move(copy));
      EXPECT_EQ(Canonical(moved), Canonical(from));
    }
  }
}

TYPED_TEST(RestrictedVoronoiCellTest, CanBeUsedAgainAfterReset) {
  constexpr int K = TypeParam::value;
  auto cell = Cell<K>(RandomHalfSpaces<K>(30, 51), 2);
  GivenHalfSpaces<K> given(10);
  cell.Reset(10, given);
  for (const auto& h : Cube<K>()) given.Clip(cell, h.id, h.normal.data(), h.offset);
  EXPECT_EQ(Canonical(cell), Canonical(Cell<K>(Cube<K>())));
}

TEST(DraftPolygon, IsTheCellByTheSameCutsBitForBit) {
  DraftPolygon made, resumed;
  for (std::uint64_t trial = 0; trial < 200; ++trial) {
    const double inradius = trial % 2 == 0 ? 10 : 3;
    HalfSpaces<2> half_spaces = RandomHalfSpaces<2>(40, trial);
    half_spaces.push_back(half_spaces.front());  // a cut by rounding at most
    made.Reset(inradius);
    RestrictedVoronoiCell<2> cell, taken;
    GivenHalfSpaces<2> given(inradius);
    cell.Reset(inradius, given);
    for (const auto& h : half_spaces) {
      resumed.Resume(cell);
      resumed.Clip(h.id, h.normal.data(), h.offset,
                   [&](std::uint32_t id, double* normal) { return given.HalfSpace(id, normal); });
      EXPECT_EQ(made.Clip(h.id, h.normal.data(), h.offset),
                given.Clip(cell, h.id, h.normal.data(), h.offset));
      taken.Take(made);
      ASSERT_EQ(resumed.count(), cell.vertex_count());
      for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
        EXPECT_EQ(resumed.id(v), cell.id(v));
        EXPECT_EQ(resumed.x(v), cell.x(v)[0]);
        EXPECT_EQ(resumed.y(v), cell.x(v)[1]);
      }
      ASSERT_EQ(taken.vertex_count(), cell.vertex_count());
      EXPECT_EQ(taken.max_norm2(), cell.max_norm2());
      EXPECT_EQ(taken.bounded(), cell.bounded());
      for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
        EXPECT_EQ(taken.id(v), cell.id(v));
        EXPECT_EQ(taken.x(v)[0], cell.x(v)[0]);
        EXPECT_EQ(taken.x(v)[1], cell.x(v)[1]);
      }
    }
  }
}

}  // namespace
}  // namespace stellate::core
