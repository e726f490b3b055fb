#include "core/label_table.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace stellate::core {
namespace {

// Two walls, each region with a label of its own outside of (-, -).
LabelTable Venn() { return LabelTable({0, 1, 2, 3}); }
// The union of the two: between its parts there is no difference.
LabelTable Union() { return LabelTable({0, 1, 1, 1}); }

TEST(LabelTable, AWallIsActiveWhereLabelsDifferAcrossIt) {
  for (const WallSet other : {0u, 2u}) EXPECT_EQ(Venn().Active(1, other), 1u) << other;
  EXPECT_EQ(Union().Active(1, 0), 1u) << "outside of the other wall";
  EXPECT_EQ(Union().Active(1, 2), 0u) << "inside of the other wall";
  EXPECT_EQ(Union().Active(3, 0), 3u) << "where both are 0";
}

TEST(LabelTable, TheSignsOfAFacesOwnWallsDoNotCount) {
  for (const WallSet own : {0u, 1u, 2u, 3u}) {
    EXPECT_EQ(Union().Active(3, own), 3u);
    EXPECT_EQ(Union().Piece(3, own), Union().Piece(3, 0));
    EXPECT_EQ(Venn().Piece(1, 2 | (own & 1)), Venn().Piece(1, 2));
  }
}

TEST(LabelTable, PiecesOfAFaceDifferByTheLabelsOnTheirSides) {
  EXPECT_EQ(Union().Piece(1, 2), 0u) << "not live";
  EXPECT_NE(Union().Piece(1, 0), 0u);
  EXPECT_NE(Venn().Piece(1, 0), Venn().Piece(1, 2)) << "0 | 1 and 2 | 3";
  const LabelTable striped({0, 1, 0, 1});
  EXPECT_EQ(striped.Piece(1, 0), striped.Piece(1, 2)) << "beyond a wall that is nowhere active";
  EXPECT_EQ(striped.Piece(3, 0), 0u);
  std::set<std::uint64_t> regions;
  for (const WallSet signs : {1u, 2u, 3u}) regions.insert(Venn().Piece(0, signs));
  EXPECT_EQ(regions.size(), 3u);
  EXPECT_EQ(Venn().Piece(0, 0), 0u) << "outside";
}

TEST(LabelTable, SectorsAreTheSidesInsideOfM) {
  EXPECT_EQ(Union().Sectors(3, 0), (std::vector<WallSet>{3, 2, 1}));
  EXPECT_EQ(Union().Sectors(1, 0), (std::vector<WallSet>{1}));
  EXPECT_EQ(Venn().Sectors(1, 2), (std::vector<WallSet>{3, 2}));
  EXPECT_EQ(Venn().Sides(1, 2), std::pair(2, 3));
}

// A point of a wall where that is not live is sent on to the wall beyond which it is.
TEST(LabelTable, TheLiveFaceIsBesideTheNearestWallThatMakesIt) {
  const double clearances[] = {0, 0.3};
  EXPECT_EQ(Union().Beside(1, 2, clearances), 1);
  EXPECT_EQ(LabelTable({0, 0, 0, 0, 0, 1, 0, 0}).Beside(1, 2, std::vector{0., .3, -.1}.data()),
            std::nullopt)
      << "two walls would have to change";
}

// Between two points of one face on different pieces lies the face of one wall more: the wall that
// the answer is the farthest beyond.
TEST(LabelTable, AnotherPieceBeginsAtAWallBetween) {
  EXPECT_EQ(Venn().Between(1, 2, 0, std::vector{0., .3}.data()), 1);
  const LabelTable three({0, 1, 2, 3, 4, 5, 6, 7});
  EXPECT_EQ(three.Between(1, 6, 0, std::vector{0., .3, .1}.data()), 1);
  EXPECT_EQ(three.Between(1, 6, 0, std::vector{0., .1, .3}.data()), 2);
}

TEST(LabelTable, AClearanceOfZeroCountsAsPositive) {
  const double clearances[] = {-1, 0, 2, -0.0};
  EXPECT_EQ(SignsOf(clearances, 4), 0b1110u);
}

}  // namespace
}  // namespace stellate::core
