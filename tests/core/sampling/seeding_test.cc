#include "core/sampling/seeding.h"

#include <gtest/gtest.h>

#include "tests/core/support/unit_sphere.h"

namespace stellate::core {
namespace {

using testing::SphereSpec;

TEST(Seeding, TakesTheClientsSeedsFirst) {
  Specification spec = SphereSpec(0.1);
  spec.seeds = Eigen::MatrixXd::Random(3, 5);
  EXPECT_EQ(SeedsOf(spec), spec.seeds);
}

TEST(Seeding, DrawsFromTheBox) {
  Specification spec = SphereSpec(0.1);
  const Eigen::MatrixXd seeds = SeedsOf(spec);
  EXPECT_EQ(seeds.cols(), kDefaultBoxSeeds);
  for (Eigen::Index i = 0; i < seeds.cols(); ++i) {
    EXPECT_TRUE((seeds.col(i).array() >= spec.bounding_box->lower.array()).all());
    EXPECT_TRUE((seeds.col(i).array() <= spec.bounding_box->upper.array()).all());
  }
  EXPECT_EQ(SeedsOf(spec), seeds);
  spec.random_seed = 2;
  EXPECT_NE(SeedsOf(spec), seeds);
  spec.box_seeds = 7;
  EXPECT_EQ(SeedsOf(spec).cols(), 7);
}

TEST(Seeding, DrawsMoreForASpeculativeRunTheFinerTheMesh) {
  Specification spec = SphereSpec(0.05);
  spec.criteria.speculative = true;
  EXPECT_GT(SeedsOf(spec).cols(), kDefaultBoxSeeds);
  spec.epsilon = 1e-6;
  EXPECT_LE(SeedsOf(spec).cols(), 3000);
}

TEST(Seeding, CoversTheBoxWhereItIsTold) {
  Specification spec = SphereSpec(0.1);
  spec.declared_reach = 0.5;
  spec.cover_box = true;
  EXPECT_EQ(SeedsOf(spec), CoverOfBox(spec));
}

}  // namespace
}  // namespace stellate::core
