#include "core/complex/sample.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/core/support/samples.h"

namespace stellate::core {
namespace {

using testing::FlatSample;
using testing::FramedPoints;

constexpr double kEverywhere = 10;
constexpr double kConormals[] = {1, 0, 0, 1};

Sample<2> SampleOf(const FramedPoints& points) {
  Sample<2> sample(points.d, 0.3);
  for (std::uint32_t i = 0; i < points.size(); ++i) sample.Add(points.Point(i), points.Tangent(i));
  return sample;
}

std::set<std::uint32_t> Near(const Sample<2>& sample, const double* q, double radius) {
  std::set<std::uint32_t> near;
  sample.ForEachWithin(q, radius, [&](std::uint32_t id) { near.insert(id); });
  return near;
}

TEST(Sample, IsAValue) {
  const FramedPoints points = FlatSample(2, 3, 100, 1), more = FlatSample(2, 3, 20, 2);
  const Sample<2> sample = SampleOf(points);
  Sample<2> copy = sample;
  const double* const moved = copy.Point(0);
  for (std::uint32_t i = 0; i < more.size(); ++i)
    copy.Add(more.Point(i), more.Tangent(i), 1, kConormals);
  EXPECT_EQ(sample.size(), points.size());
  EXPECT_EQ(copy.size(), points.size() + more.size());
  EXPECT_NE(sample.Point(0), moved);
  EXPECT_TRUE(sample.boundary().empty());
  EXPECT_EQ(copy.boundary().size(), more.size());
  for (std::uint32_t i = 0; i < more.size(); ++i) {
    EXPECT_EQ(Near(copy, more.Point(i), 0), std::set{points.size() + i});
    EXPECT_TRUE(Near(sample, more.Point(i), 0).empty());
  }
  EXPECT_EQ(Near(sample, points.Point(0), kEverywhere).size(), points.size());
}

// Two samples that go on apart give one id to different points, and a CentreCache must not take the
// centres of one for the other's.
TEST(Sample, HasCentresOfItsOwnAsSoonAsItMayDifferFromAnother) {
  Sample<2> sample = SampleOf(FlatSample(2, 3, 10, 1));
  const Sample<2> copy = sample;
  EXPECT_NE(copy.centre_owner(), sample.centre_owner());
  const std::uint64_t before = sample.centre_owner();
  sample.SetProtectingBalls(std::vector<double>(10, 0.01));
  EXPECT_NE(sample.centre_owner(), before);
}

TEST(Sample, FindsUnindexedPointsOnceItIsIndexed) {
  const FramedPoints points = FlatSample(2, 3, 50, 3);
  Sample<2> sample(3, 0.3);
  for (std::uint32_t i = 0; i < points.size(); ++i)
    sample.AddUnindexed(points.Point(i), points.Tangent(i), 0.1 * (i + 1));
  EXPECT_FALSE(sample.is_indexed());
  EXPECT_TRUE(Near(sample, points.Point(7), kEverywhere).empty());
  sample.Index(BallTree::Halving::kExtent, 4);
  EXPECT_TRUE(sample.is_indexed());
  EXPECT_EQ(Near(sample, points.Point(7), kEverywhere).size(), points.size());
  EXPECT_DOUBLE_EQ(sample.BoundAt(7), 0.8);
  sample.ForgetBounds();
  EXPECT_EQ(sample.BoundAt(7), 0.3);
}

TEST(Sample, WeighsPointsByTheirNames) {
  const FramedPoints points = FlatSample(2, 3, 10, 4);
  const Sample<2> whole = SampleOf(points);
  Sample<2> part(3, 0.3);
  for (const std::uint32_t i : {0u, 3u, 7u}) {
    part.Add(points.Point(i), points.Tangent(i));
    part.NameLast(i);
  }
  EXPECT_EQ(part.NameOf(2), 7u);
  EXPECT_EQ(part.Weight(2), whole.Weight(7));
  EXPECT_NE(part.Weight(2), whole.Weight(2));
}

}  // namespace
}  // namespace stellate::core
