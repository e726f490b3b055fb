#include "core/parts/boxes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <vector>

#include "core/base/random.h"

namespace stellate::core {
namespace {

std::vector<double> RandomPoints(std::size_t count, int d, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> points(count * static_cast<std::size_t>(d));
  for (double& x : points) x = static_cast<double>(random.Next() >> 11) * 0x1p-53;
  return points;
}

TEST(Boxes, HoldEquallyManyOfTheirPoints) {
  const int d = 3;
  const std::vector<double> points = RandomPoints(1000, d, 1);
  for (const int parts : {1, 2, 3, 5, 8, 64}) {
    const Boxes boxes(points, d, parts);
    EXPECT_EQ(boxes.parts(), parts);
    std::vector<int> held(static_cast<std::size_t>(parts));
    for (std::size_t i = 0; i < 1000; ++i)
      ++held[static_cast<std::size_t>(boxes.OwnerOf(points.data() + i * d))];
    EXPECT_GE(*std::min_element(held.begin(), held.end()), 1000 / parts - 1) << parts;
    EXPECT_LE(*std::max_element(held.begin(), held.end()), 1000 / parts + 1) << parts;
  }
}

TEST(Boxes, AreAllOfSpaceIfThereIsOne) {
  const double far[] = {1e300, -1e300};
  EXPECT_EQ(Boxes().parts(), 1);
  EXPECT_EQ(Boxes().OwnerOf(far), 0);
}

// Equal coordinates fall to one side or the other, whole.
TEST(Boxes, TakePointsThatCoincideAndFew) {
  const std::vector<double> points(20, 0.5);
  const double point[] = {0.5, 0.5};
  for (const std::size_t count : {0u, 2u, 20u}) {  // and fewer than parts
    const Boxes boxes(std::span<const double>(points).first(count), 2, 4);
    EXPECT_EQ(boxes.parts(), 4);
    EXPECT_LT(boxes.OwnerOf(point), 4);
  }
}

// What a part has to know: whatever lies within the halo of anything of its own. Boxes are thinner
// than the halo here.
TEST(Boxes, ShowAPointToAllWhoOwnSomethingNear) {
  for (const int d : {2, 3})
    for (const int parts : {2, 3, 5, 8, 40}) {
      const Boxes boxes(RandomPoints(80, d, 2), d, parts);
      const std::vector<double> points = RandomPoints(600, d, 3);
      const double halo = 0.2;
      std::size_t shown = 0;
      for (std::size_t i = 0; i < 600; ++i) {
        const double* const point = points.data() + i * static_cast<std::size_t>(d);
        std::multiset<int> near;
        boxes.ForEachNear(point, halo, [&](int part) { near.insert(part); });
        EXPECT_EQ(near.count(boxes.OwnerOf(point)), 1u);
        shown += near.size();
        for (const int part : near) EXPECT_EQ(near.count(part), 1u);
        for (std::size_t j = 0; j < 600; ++j) {
          const double* const other = points.data() + j * static_cast<std::size_t>(d);
          double distance2 = 0;
          for (int a = 0; a < d; ++a) distance2 += (point[a] - other[a]) * (point[a] - other[a]);
          if (distance2 > halo * halo) continue;
          ASSERT_EQ(near.count(boxes.OwnerOf(other)), 1u) << parts;
        }
      }
      EXPECT_LT(shown, 600u * static_cast<unsigned>(parts));  // and not to all
    }
}

}  // namespace
}  // namespace stellate::core
