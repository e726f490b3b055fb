#include <gtest/gtest.h>

#include <cstdint>

#include "stellate/mesh.h"

namespace stellate {
namespace {

TEST(OrientedSimplices, LeavesAOneSidedSurfaceAlone) {
  SimplexMatrix plane(3, 10);             // the six-vertex projective plane
  plane << 0, 0, 0, 0, 0, 1, 1, 1, 2, 2,  //
      1, 1, 2, 3, 4, 2, 3, 4, 3, 3,       //
      2, 3, 4, 5, 5, 5, 4, 5, 4, 5;
  EXPECT_EQ(OrientedSimplices(plane), plane);
}

TEST(OrientedSimplices, LeavesABranchingComplexAlone) {
  SimplexMatrix book(3, 3);  // three pages on one edge
  book << 0, 0, 0, 1, 1, 1, 2, 3, 4;
  EXPECT_EQ(OrientedSimplices(book), book);
}

TEST(OrientedSimplices, OrientsThreeSpheres) {
  // The boundary of the 4-simplex: signs must alternate with the vertex left out.
  SimplexMatrix sphere(4, 5);
  for (int drop = 0; drop < 5; ++drop) {
    for (int i = 0; i < 4; ++i) sphere(i, drop) = static_cast<std::uint32_t>(i < drop ? i : i + 1);
  }
  const SimplexMatrix oriented = OrientedSimplices(sphere);
  for (int j = 0; j < 5; ++j) {
    const bool swapped = oriented(2, j) > oriented(3, j);
    EXPECT_EQ(swapped, j % 2 == 1) << j;
  }
}

}  // namespace
}  // namespace stellate
