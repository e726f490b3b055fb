#include "core/geometry/reach.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace stellate::core {
namespace {

// A chord of a circle is the simplex that these are exact for.
TEST(Reach, IsExactForAChordOfACircle) {
  for (const double half : {1e-6, 0.1, 0.7, 1.2}) {  // the angle to its end, radians
    const double reach = 3;
    EXPECT_NEAR(LargestDistance(reach * std::sin(half), reach) / (reach * (1 - std::cos(half))), 1,
                1e-4);
    // From an end of the chord to its middle's closest point the circle turns by `half`.
    EXPECT_GE(LargestTurn(reach * std::sin(half), reach), half);
  }
}

TEST(Reach, KnowsNothingOfSimplicesAsLargeAsIt) {
  EXPECT_TRUE(std::isinf(LargestDistance(1, 1)));
  EXPECT_TRUE(std::isinf(LargestTurn(1, 1)));
  EXPECT_TRUE(std::isinf(LargestTurn(std::numeric_limits<double>::quiet_NaN(), 1)));
}

TEST(Reach, InvertsTheTurn) {
  for (const double turn : {0.0, 0.01, 0.7, 1.5})
    EXPECT_NEAR(LargestTurn(RadiusThatTurns(turn, 2), 2), turn, 1e-9);
}

TEST(Reach, JungsBallHoldsTheRegularSimplex) {
  EXPECT_DOUBLE_EQ(JungRatio(1), 0.5);
  EXPECT_DOUBLE_EQ(JungRatio(2), 1 / std::sqrt(3.0));
  EXPECT_DOUBLE_EQ(JungRatio(3), std::sqrt(3.0 / 8));
}

}  // namespace
}  // namespace stellate::core
