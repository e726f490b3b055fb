#include "core/reconstruction/neighbour_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

using Found = std::vector<std::pair<double, std::uint32_t>>;

Found NearestOfAll(const std::vector<double>& points, int d, std::uint32_t p, std::size_t count) {
  const auto stride = static_cast<std::size_t>(d);
  Found all;
  for (std::uint32_t q = 0; q < points.size() / stride; ++q)
    all.emplace_back(SquaredDistance(points.data() + p * stride, points.data() + q * stride, d), q);
  std::sort(all.begin(), all.end());
  all.resize(std::min(count, all.size()));
  return all;
}

void ExpectNearest(const std::vector<double>& points, int d, int count) {
  const NeighbourSearch search(points, d);
  std::vector<Found> found(points.size() / static_cast<std::size_t>(d));
  search.ForEach(
      count, [] { return 0; },
      [&](std::uint32_t p, Neighbours near, int) { found[p].assign(near.begin(), near.end()); });
  for (std::uint32_t p = 0; p < found.size(); ++p)
    ASSERT_EQ(found[p], NearestOfAll(points, d, p, static_cast<std::size_t>(count)))
        << "of " << p << " in R^" << d;
}

// Of half of the points the spacing is a hundredth of the others': a bunch's neighbours say little
// of the next one's.
TEST(NeighbourSearch, FindsTheNearestWhereTheSpacingChanges) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform;
  for (const int d : {2, 3, 6, 9, 12}) {
    std::vector<double> points;
    for (int p = 0; p < 800; ++p)
      for (int i = 0; i < d; ++i) points.push_back((p % 2 ? 1 : 0.01) * uniform(random));
    ExpectNearest(points, d, 21);
  }
}

TEST(NeighbourSearch, OrdersEquallyNearOnesById) {
  std::vector<double> points;
  for (int x = 0; x < 12; ++x)
    for (int y = 0; y < 12; ++y)
      for (int z = 0; z < 3; ++z)
        points.insert(points.end(), {1.0 * (y * 5 % 12), 1.0 * x, 1.0 * z});
  ExpectNearest(points, 3, 13);
}

TEST(NeighbourSearch, FindsAllOfFewPoints) {
  ExpectNearest({0, 0, 1, 0, 0, 1, 5, 5}, 2, 4);
  ExpectNearest({1, 1, 1, 1, 1, 1, 1, 1}, 2, 3);  // all are equal
}

}  // namespace
}  // namespace stellate::core
