#include "core/geometry/draft_polytope.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/geometry/restricted_voronoi_cell.h"
#include "tests/core/support/cells.h"
#include "tests/core/support/half_spaces.h"

namespace stellate::core {
namespace {

using testing::CombinatoricsHold;
using testing::GivenHalfSpaces;
using testing::HalfSpaces;
using testing::RandomHalfSpaces;

void ExpectSame(const RestrictedVoronoiCell<3>& taken, const RestrictedVoronoiCell<3>& cell) {
  ASSERT_EQ(taken.facet_count(), cell.facet_count());
  for (std::size_t f = 0; f < cell.facet_count(); ++f) {
    EXPECT_EQ(taken.id(f), cell.id(f));
    EXPECT_EQ(taken.offset(f), cell.offset(f));
    for (int a = 0; a < 3; ++a) EXPECT_EQ(taken.normal(f)[a], cell.normal(f)[a]);
  }
  ASSERT_EQ(taken.vertex_count(), cell.vertex_count());
  EXPECT_EQ(taken.max_norm2(), cell.max_norm2());
  EXPECT_EQ(taken.bounded(), cell.bounded());
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    EXPECT_EQ(taken.key(v), cell.key(v));
    EXPECT_EQ(taken.norm2(v), cell.norm2(v));
    EXPECT_EQ(taken.judged(v), cell.judged(v));
    for (int a = 0; a < 3; ++a) EXPECT_EQ(taken.x(v)[a], cell.x(v)[a]);
    for (int s = 0; s < 3; ++s) {
      EXPECT_EQ(taken.facet(v, s), cell.facet(v, s));
      EXPECT_EQ(taken.adjacent(v, s), cell.adjacent(v, s));
    }
  }
}

TEST(DraftPolytope, IsTheCellByTheSameCutsBitForBit) {
  DraftPolytope made;
  for (std::uint64_t trial = 0; trial < 200; ++trial) {
    const double inradius = trial % 2 == 0 ? 10 : 3;
    const HalfSpaces<3> half_spaces = RandomHalfSpaces<3>(60, trial);
    made.Reset(inradius);
    RestrictedVoronoiCell<3> cell, taken;
    GivenHalfSpaces<3> given(inradius);
    cell.Reset(inradius, given);
    for (const auto& h : half_spaces) {
      EXPECT_EQ(made.Clip(h.id, h.normal.data(), h.offset),
                given.Clip(cell, h.id, h.normal.data(), h.offset));
      taken.Take(made);
      ExpectSame(taken, cell);
      EXPECT_TRUE(CombinatoricsHold(taken));
    }
    EXPECT_FALSE(made.gave_up());
  }
}

TEST(DraftPolytope, CanBeCutAsACellAfterwards) {
  const HalfSpaces<3> half_spaces = RandomHalfSpaces<3>(40, 7);
  GivenHalfSpaces<3> given(10);
  DraftPolytope made;
  RestrictedVoronoiCell<3> cell, taken;
  made.Reset(10);
  cell.Reset(10, given);
  for (std::size_t i = 0; i < half_spaces.size(); ++i) {
    const auto& h = half_spaces[i];
    given.Clip(cell, h.id, h.normal.data(), h.offset);
    if (i < 20) made.Clip(h.id, h.normal.data(), h.offset);
    if (i == 19) taken.Take(made);
    if (i > 19) given.Clip(taken, h.id, h.normal.data(), h.offset);
  }
  ExpectSame(taken, cell);
}

// More facets than it has bits for: points on a sphere, each of which cuts.
TEST(DraftPolytope, GivesUpWhereItHasNoRoom) {
  DraftPolytope made;
  made.Reset(100);
  bool cut = true;
  for (std::uint32_t i = 0; i < 1000 && cut; ++i) {
    const double z = 1 - (2.0 * i + 1) / 1000, angle = 2.4 * i, r = std::sqrt(1 - z * z);
    const double normal[3] = {r * std::cos(angle), r * std::sin(angle), z};
    cut = made.Clip(i, normal, 1);
  }
  EXPECT_TRUE(made.gave_up());
  EXPECT_EQ(made.max_norm2(), 0);
  const double closer[3] = {0, 0, 1};
  EXPECT_FALSE(made.Clip(1000, closer, 0.5));
}

}  // namespace
}  // namespace stellate::core
