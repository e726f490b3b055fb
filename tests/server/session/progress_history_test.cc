#include "server/session/progress_history.h"

#include <gtest/gtest.h>

namespace stellate::server {
namespace {

ProgressHistory HistoryOf(std::uint64_t revisions) {
  ProgressHistory history;
  for (std::uint64_t r = 1; r <= revisions; ++r) {
    PastProgress past;
    past.revision = r;
    past.progress.vertices = 10 * r;
    history.Add(past);
  }
  return history;
}

TEST(ProgressHistory, KeepsEachRevisionOfAnOrdinaryMesh) {
  const ProgressHistory history = HistoryOf(100);
  ASSERT_EQ(history.all().size(), 100u);
  const std::vector<PastProgress> late = history.After(97);
  ASSERT_EQ(late.size(), 3u);
  EXPECT_EQ(late.front().revision, 98u);
  EXPECT_EQ(late.front().progress.vertices, 980u);
  EXPECT_TRUE(history.After(100).empty());
  EXPECT_TRUE(ProgressHistory().After(0).empty());
}

TEST(ProgressHistory, ThinsOutEvenlyAndHasTheNewest) {
  for (const std::uint64_t revisions : {4095, 4096, 4097, 8191, 10001, 100003}) {
    const ProgressHistory history = HistoryOf(revisions);
    const std::vector<PastProgress>& all = history.all();
    EXPECT_LT(all.size(), ProgressHistory::kMost);
    EXPECT_GE(all.size(), std::min<std::size_t>(revisions, ProgressHistory::kMost / 2));
    EXPECT_EQ(all.back().revision, revisions);
    const std::uint64_t step = all.front().revision;
    for (std::size_t i = 0; i + 1 < all.size(); ++i) {
      ASSERT_EQ(all[i].revision, (i + 1) * step) << revisions;
    }
  }
}

}  // namespace
}  // namespace stellate::server
