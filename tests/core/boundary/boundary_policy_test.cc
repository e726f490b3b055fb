#include "core/boundary/boundary_policy.h"

#include <gtest/gtest.h>

#include <vector>

namespace stellate::core {
namespace {

Specification SpecOf(int k, int d, int walls) {
  Specification spec;
  spec.dimension = k;
  spec.ambient_dimension = d;
  spec.walls = walls;
  return spec;
}

void ExpectNone(const BoundaryPolicy& policy, int k) {
  EXPECT_EQ(policy.first_stage(), k);
  EXPECT_EQ(policy.last_stage(), k);
  EXPECT_FALSE(policy.MeshesFacesFirst());
  EXPECT_FALSE(policy.LeavesInside());
  EXPECT_FALSE(policy.SharpensDihedrals());
  EXPECT_TRUE(policy.FacesOfSeeds(3).empty());
  EXPECT_EQ(policy.QueriesOfSeed(), 1);
  EXPECT_FALSE(policy.TakesClearances());
  EXPECT_TRUE(policy.MayAlternate());
  EXPECT_FALSE(policy.FillsSpace());
  EXPECT_TRUE(policy.MayEndUndeclared());
}

TEST(BoundaryPolicyTest, IsNoneWithoutWalls) {
  for (const int k : {1, 2, 3, 4, 5}) {
    ExpectNone(BoundaryPolicy::None(k), k);
    ExpectNone(BoundaryPolicy(SpecOf(k, k + 1, 0)), k);
  }
}

TEST(BoundaryPolicyTest, AsksForEachSeedOnMAndOnEachWall) {
  const BoundaryPolicy policy(SpecOf(2, 3, 2));
  EXPECT_EQ(policy.FacesOfSeeds(2), (std::vector<WallSet>{0, 0, 1, 1, 2, 2}));
  EXPECT_EQ(policy.QueriesOfSeed(), 3);
  QueryBlock block;
  policy.AddWishes(&block);
  EXPECT_TRUE(block.want.clearances);
  BoundaryPolicy::None(2).AddWishes(&block);
  EXPECT_FALSE(block.want.clearances);
}

TEST(BoundaryPolicyTest, MeshesFacesByDimensionThenTheInside) {
  const BoundaryPolicy policy(SpecOf(2, 3, 1));
  EXPECT_EQ(policy.first_stage(), 0);
  EXPECT_EQ(policy.last_stage(), 2);
  EXPECT_TRUE(policy.MeshesFacesFirst());
  EXPECT_FALSE(policy.MayAlternate());
  EXPECT_FALSE(policy.MayEndUndeclared());
  Specification alone = SpecOf(3, 3, 1);
  alone.boundary_only = true;
  EXPECT_EQ(BoundaryPolicy(alone).last_stage(), 2);
  EXPECT_TRUE(BoundaryPolicy(alone).LeavesInside());
}

TEST(BoundaryPolicyTest, KnowsSolids) {
  EXPECT_TRUE(BoundaryPolicy(SpecOf(3, 3, 1)).FillsSpace());
  EXPECT_TRUE(BoundaryPolicy(SpecOf(3, 3, 1)).SharpensDihedrals());
  EXPECT_FALSE(BoundaryPolicy(SpecOf(3, 4, 1)).FillsSpace());
  EXPECT_TRUE(BoundaryPolicy(SpecOf(3, 4, 1)).SharpensDihedrals());
  EXPECT_FALSE(BoundaryPolicy(SpecOf(2, 2, 1)).SharpensDihedrals());
}

}  // namespace
}  // namespace stellate::core
