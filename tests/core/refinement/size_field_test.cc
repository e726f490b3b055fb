#include "core/refinement/size_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "core/refinement/protecting_balls.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::Make;
using testing::RandomSample;

Specification Spec(double epsilon) {
  Specification spec;
  spec.dimension = 2;
  spec.ambient_dimension = 3;
  spec.epsilon = epsilon;
  return spec;
}

Stars<2> ComplexOn(const std::string& manifold, int count) {
  Stars<2> stars(3, 0.3, {3, CentreRule::kTangentSpace});
  AppendTo(&stars, RandomSample(*Make(manifold), count, 1));
  stars.Commit();
  return stars;
}

std::vector<std::uint32_t> All(const Stars<2>& stars) {
  std::vector<std::uint32_t> all(stars.size());
  std::iota(all.begin(), all.end(), 0u);
  return all;
}

TEST(SizeField, IsEpsilonWhereNothingIsGraded) {
  const SizeField<2> sizes(Resolve(Spec(0.3)));
  EXPECT_FALSE(sizes.is_estimated());
  EXPECT_EQ(sizes.given(), nullptr);
  EXPECT_EQ(sizes.BoundAt(ComplexOn("sphere", 20), 7), 0.3);
}

TEST(SizeField, FollowsWhatIsGivenUpToEpsilonAndDownToTheFinest) {
  Specification spec = Spec(0.3);
  spec.oracle.local_size = true;
  spec.criteria.size_rate = 0.5;
  SizeField<2> sizes(Resolve(spec));
  for (const double size : {0.2, 100.0, 1e-9}) sizes.AppendGiven(size);
  const Stars<2> stars = ComplexOn("sphere", 20);
  EXPECT_FALSE(sizes.is_estimated());
  EXPECT_EQ(sizes.given()[1], 100);
  EXPECT_DOUBLE_EQ(sizes.BoundAt(stars, 0), 0.1);
  EXPECT_EQ(sizes.BoundAt(stars, 1), 0.3);
  EXPECT_EQ(sizes.BoundAt(stars, 2), sizes.FinestBound());
  EXPECT_LT(sizes.FinestBound(), 0.3 / 1000);
  EXPECT_EQ(sizes.CountTooFine(), 1u);
}

TEST(SizeField, BoundsTheDeviation) {
  Specification spec = Spec(0.3);
  spec.oracle.local_size = true;
  spec.criteria.max_deviation = 0.01;
  const SizeField<2> sizes(Resolve(spec));
  const double bound = sizes.BoundFor(1);
  EXPECT_DOUBLE_EQ(bound * bound / (2 * 1), 0.01);
}

// |q - p|^2 / (2 dist(q, T_p)) is 1 for any two points of the unit sphere.
TEST(SizeField, SeesTheRadiusOfASphere) {
  Specification spec = Spec(0.6);
  spec.criteria.size_rate = 0.4;
  SizeField<2> sizes(Resolve(spec));
  EXPECT_TRUE(sizes.is_estimated());
  const Stars<2> stars = ComplexOn("sphere", 200);
  sizes.Look(stars, All(stars));
  double most = 0;
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    EXPECT_NEAR(sizes.BoundAt(stars, p), 0.4, 1e-6);
    most = std::max(most, std::sqrt(stars.cell(p).max_norm2()));
  }
  EXPECT_NEAR(sizes.MaxRadiusOverSize(stars), most, 1e-6 * most);
}

// No point is inserted into a protecting ball: a finer bound at its centre could never hold.
TEST(SizeField, AsksForNoPointInAProtectingBall) {
  Specification spec = Spec(0.6);
  spec.criteria.size_rate = 0.1;
  SizeField<2> sizes(Resolve(spec));
  Stars<2> stars = ComplexOn("sphere", 200);
  std::vector<double> radii2(stars.size(), 0.0);
  radii2[3] = 0.09 * 0.09;
  radii2[5] = 0.01 * 0.01;
  stars.SetProtectingBalls(radii2);
  sizes.Look(stars, All(stars));
  EXPECT_DOUBLE_EQ(sizes.BoundAt(stars, 3), 0.09 / kLargestBall);
  EXPECT_NEAR(sizes.BoundAt(stars, 5), 0.1, 1e-6) << "a small ball leaves the bound as it is";
  EXPECT_NEAR(sizes.BoundAt(stars, 7), 0.1, 1e-6);
}

TEST(SizeField, IsLipschitzOnceSpread) {
  Specification spec = Spec(10);
  spec.criteria.size_rate = 1;
  SizeField<2> sizes(Resolve(spec));
  const Stars<2> stars = ComplexOn("ellipsoid:1:0.6:0.3", 400);
  sizes.Look(stars, All(stars));
  EXPECT_TRUE(sizes.NeedsSpreading(stars, true));
  sizes.Spread(stars);
  EXPECT_FALSE(sizes.NeedsSpreading(stars, true));
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    const auto& cell = stars.cell(p);
    for (std::size_t f = 0; f < cell.facet_count(); ++f) {
      const double apart = std::sqrt(stars.EdgeLength2(p, f));
      EXPECT_LE(sizes.BoundAt(stars, p), sizes.BoundAt(stars, cell.id(f)) + apart * (1 + 1e-6));
    }
  }
  sizes.Look(stars, {0});
  EXPECT_TRUE(sizes.NeedsSpreading(stars, true));
  EXPECT_FALSE(sizes.NeedsSpreading(stars, false));
}

}  // namespace
}  // namespace stellate::core
