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

// Three phases: walls f0 - f1, f0 - f2, f1 - f2.
LabelTable Phases() {
  // By f0 > f1, f0 > f2, f1 > f2 as bits: 0 is 2 > 1 > 0, and 2 > 0 > 1 with f1 > f2 is impossible.
  return LabelTable({3, 3, -1, 1, 2, -1, 2, 1}, Closures({0b111}));
}

TEST(Closures, OfDependentWallsAFaceTakesFewer) {
  const Closures three({0b111});
  EXPECT_EQ(three.Close(0b011), 0b111u);
  EXPECT_EQ(three.Close(0b101), 0b111u);
  EXPECT_EQ(three.Close(0b010), 0b010u);
  EXPECT_EQ(three.Close(0b1001), 0b1001u);
  EXPECT_EQ(three.Codimension(0b111), 2);
  EXPECT_EQ(three.Codimension(0b1111), 3);
  EXPECT_EQ(Closures().Codimension(0b111), 3);
  // Four phases, walls 01, 02, 03, 12, 13, 23: three of them that connect all imply the rest.
  const Closures four({0b001011, 0b010101, 0b100110, 0b111000});
  EXPECT_EQ(four.Close(0b000111), 0b111111u);
  EXPECT_EQ(four.Close(0b100001), 0b100001u) << "f0 = f1 and f2 = f3";
  EXPECT_EQ(four.Codimension(0b111111), 3);
}

TEST(LabelTable, WherePhasesMeetThereIsASectorForEachOrder) {
  const LabelTable phases = Phases();
  EXPECT_EQ(phases.Sectors(0b111, 0).size(), 6u);
  for (const WallSet order : phases.Sectors(0b111, 0))
    EXPECT_EQ(CountWalls(phases.Bounds(0b111, order)), 2) << order;
  EXPECT_EQ(phases.Bounds(0b111, 0b111), 0b101u) << "f0 > f1 > f2: not f0 - f2";
  EXPECT_EQ(phases.Active(0b011, 0), 0b111u);
  EXPECT_NE(phases.Piece(0b011, 0), 0u);
  EXPECT_EQ(phases.Piece(0b011, 0), phases.Piece(0b111, 0));
  EXPECT_EQ(phases.Piece(0b001, 0b000), 0u) << "f2 is above f0 = f1";
  EXPECT_NE(phases.Piece(0b001, 0b110), 0u) << "f2 is below";
  EXPECT_EQ(phases.Piece(0, 0b111), phases.Piece(0, 0b011)) << "the two orders of phase 1";
  EXPECT_EQ(phases.Piece(0, 0b010), 0u) << "impossible";
  EXPECT_TRUE(phases.IsPossible(0b010, 0b001));
  EXPECT_FALSE(phases.IsPossible(0b010, 0));
  // Beside f0 = f1 < f2 the wall is live where f2 is below: f0 - f2 and f1 - f2 change together.
  const double clearances[] = {0, -0.2, -0.2};
  EXPECT_EQ(phases.Beside(0b001, 0b000, clearances), 1);
}

TEST(LabelTable, AClearanceOfZeroCountsAsPositive) {
  const double clearances[] = {-1, 0, 2, -0.0};
  EXPECT_EQ(SignsOf(clearances, 4), 0b1110u);
}

}  // namespace
}  // namespace stellate::core
