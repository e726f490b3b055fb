#include "core/complex/star_builder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/complex/bulk_star_builder.h"
#include "core/complex/stars.h"
#include "tests/core/support/cells.h"
#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::AppendTo;
using testing::Canonical;
using testing::FramedPoints;
using testing::Make;
using testing::RandomSample;

constexpr StarOptions kOptions{.inradius = 3, .centre_rule = CentreRule::kTangentSpace};

template <int K>
FramedPoints PointsOfDimension(int count, std::uint64_t seed) {
  const char* names[] = {"", "torus-knot:2:3", "torus:1:0.4", "so3", "sphere:4:6"};
  return RandomSample(*Make(names[K]), count, seed);
}

template <typename T>
class StarBuilderTest : public ::testing::Test {};
template <int K>
using Dimension = std::integral_constant<int, K>;
using Dimensions = ::testing::Types<Dimension<1>, Dimension<2>, Dimension<3>, Dimension<4>>;
TYPED_TEST_SUITE(StarBuilderTest, Dimensions);

// In the flats a star does not depend on how it came about: point by point, by itself with and
// without knowing what to cut by first, or with all others at the same time.
TYPED_TEST(StarBuilderTest, BuildsTheSameStarInEachWay) {
  constexpr int K = TypeParam::value;
  const FramedPoints points = PointsOfDimension<K>(K == 4 ? 100 : 250, 1);
  Stars<K> stars(points.d, 0.3, kOptions);
  AppendTo(&stars, points);
  stars.Commit();
  const StarBuilder<K> builder(stars.sample(), kOptions);
  Blocks<RestrictedVoronoiCell<K>> all;
  all.resize(points.size());
  std::vector<double> influence(points.size());
  BulkStarBuilder<K>(builder).Build(&all, influence.data());
  RestrictedVoronoiCell<K> star;
  std::vector<std::uint32_t> influenced, first;
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    const auto expected = Canonical(stars.cell(p));
    EXPECT_EQ(Canonical(all[p]), expected) << "star " << p;
    EXPECT_DOUBLE_EQ(influence[p], builder.Influence(p, stars.cell(p)));
    builder.Build(stars.sample().At(p), {}, &star, &influenced);
    EXPECT_EQ(Canonical(star), expected) << "star " << p;
    first.clear();
    for (std::size_t f = 0; f < star.facet_count(); ++f)
      if (IsSample(star.id(f))) first.push_back(star.id(f));
    std::reverse(first.begin(), first.end());
    builder.Build(stars.sample().At(p), first, &star, &influenced);
    EXPECT_EQ(Canonical(star), expected) << "star " << p;
  }
}

// ... and those that a new point cuts are among those that it may influence.
TYPED_TEST(StarBuilderTest, FindsAllStarsThatAPointCuts) {
  constexpr int K = TypeParam::value;
  const FramedPoints points = PointsOfDimension<K>(K == 4 ? 100 : 250, 2);
  const FramedPoints more = PointsOfDimension<K>(20, 3);
  Stars<K> stars(points.d, 0.3, kOptions);
  AppendTo(&stars, points);
  stars.Commit();
  const StarBuilder<K> builder(stars.sample(), kOptions);
  RestrictedVoronoiCell<K> star;
  std::vector<std::uint32_t> influenced;
  for (std::uint32_t i = 0; i < more.size(); ++i) {
    const Site site{stars.size(), more.Point(i), more.Tangent(i)};
    builder.Build(site, {}, &star, &influenced);
    std::size_t cut = 0;
    for (std::uint32_t p = 0; p < stars.size(); ++p) {
      if (!builder.IsCutBy(stars.cell(p), stars.sample().At(p), site)) continue;
      ++cut;
      EXPECT_NE(std::find(influenced.begin(), influenced.end(), p), influenced.end());
    }
    EXPECT_GT(cut, 0u);
  }
}

}  // namespace
}  // namespace stellate::core
