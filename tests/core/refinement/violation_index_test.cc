#include "core/refinement/violation_index.h"

#include <gtest/gtest.h>

#include <vector>

namespace stellate::core {
namespace {

using Book = ViolationIndex<2>;
using Ids = std::vector<std::uint32_t>;

Ids Entered(const Book& book) {
  Ids stars;
  for (const auto& entry : book.size_and_shape()) stars.push_back(entry.star);
  return stars;
}

// Five stars, of which 1, 3 and 4 break R1.
Book FiveStars() {
  Book book;
  const Violation<2> bad;
  book.Update(5, {0, 1, 2, 3, 4}, {{1, bad}, {3, bad}, {4, bad}});
  return book;
}

TEST(ViolationIndex, HoldsOneEntryForEachStarThatBreaksR1OrR2) {
  Book book = FiveStars();
  EXPECT_EQ(Entered(book), (Ids{1, 3, 4}));
  // 3 was mended, 0 and a new star were broken.
  book.Update(6, {0, 3, 5}, {{0, {}}, {5, {}}});
  EXPECT_EQ(Entered(book), (Ids{1, 4, 0, 5}));
  book.Replace({{2, {}}});
  EXPECT_EQ(Entered(book), Ids{2});
}

TEST(ViolationIndex, ForgetsFailuresOfAStarThatChanges) {
  Book book = FiveStars();
  book.NoteFailedAttempt(1);
  book.NoteNoFlat(1);
  book.NoteFailedAttempt(3);
  book.Update(5, {1}, {{1, {}}});
  EXPECT_EQ(book.failed_attempts(1), 0);
  EXPECT_FALSE(book.has_no_flat(1));
  EXPECT_EQ(book.failed_attempts(3), 1);
}

TEST(ViolationIndex, GivesUpAfterManyAttemptsOrAtOnce) {
  Book book = FiveStars();
  int attempts = 0;
  for (; !book.is_given_up(1); ++attempts) book.NoteFailedAttempt(1);
  EXPECT_EQ(attempts, 9);
  for (int i = 0; i < 1000; ++i) book.NoteFailedAttempt(1);
  EXPECT_TRUE(book.is_given_up(1));
  book.GiveUp(3);
  EXPECT_TRUE(book.is_given_up(3));
  book.NoteNoFlat(4);
  book.ForgetFlats();
  EXPECT_FALSE(book.has_no_flat(4));
}

TEST(ViolationIndex, HasAllDirtyUntilTheyWereTakenOnce) {
  Book book = FiveStars();
  EXPECT_TRUE(book.are_all_dirty());
  EXPECT_EQ(book.TakeDirty({}), (Ids{0, 1, 2, 3, 4}));
  EXPECT_FALSE(book.are_all_dirty());
  EXPECT_EQ(book.TakeDirty({}), Ids{});
  book.MarkDirty({3, 2});
  book.MarkDirty({2});
  EXPECT_EQ(book.TakeDirty({4}), (Ids{2, 3, 4}));
}

TEST(ViolationIndex, JudgesViolatingStarsAgain) {
  Book book = FiveStars();
  book.TakeDirty({});
  book.NoteJudged(0, Rule::kShape);
  book.NoteJudged(2, Rule::kInconsistent);
  book.NoteJudged(3, std::nullopt);
  EXPECT_EQ(book.violating(), 2u);
  EXPECT_EQ(book.slivers(), 1u);
  EXPECT_EQ(book.inconsistent(), 1u);
  book.MarkDirty({1});
  EXPECT_EQ(book.TakeDirty({}), (Ids{0, 1, 2}));
  EXPECT_EQ(book.violating(), 0u);
  book.MarkAllDirty();
  EXPECT_EQ(book.TakeDirty({}).size(), 5u);
}

}  // namespace
}  // namespace stellate::core
