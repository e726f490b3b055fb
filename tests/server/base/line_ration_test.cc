#include "server/base/line_ration.h"

#include <gtest/gtest.h>

namespace stellate::server {
namespace {

using namespace std::chrono_literals;

constexpr int kBurst = 5;
const LineRation::Time kStart{1000s};

TEST(LineRation, ABurstAndThenSoManyASecond) {
  LineRation ration(kBurst, 2);
  for (int i = 0; i < kBurst; ++i) EXPECT_TRUE(ration.Take("a", kStart)) << i;
  EXPECT_FALSE(ration.Take("a", kStart));
  EXPECT_FALSE(ration.Take("a", kStart + 400ms));
  EXPECT_TRUE(ration.Take("a", kStart + 500ms));
  EXPECT_FALSE(ration.Take("a", kStart + 500ms));
  int written = 0;
  for (int i = 1; i <= 1000; ++i) written += ration.Take("a", kStart + 500ms + i * 10ms);
  EXPECT_EQ(written, 20) << "in ten seconds";
}

TEST(LineRation, EachPartyHasItsOwn) {
  LineRation ration(kBurst, 2);
  for (int i = 0; i < 100; ++i) ration.Take("a", kStart);
  EXPECT_TRUE(ration.Take("b", kStart));
  const auto left_out = ration.TakeLeftOut(kStart);
  ASSERT_EQ(left_out.size(), 1u);
  EXPECT_EQ(left_out[0].first, "a");
  EXPECT_EQ(left_out[0].second, 100u - kBurst);
  EXPECT_TRUE(ration.TakeLeftOut(kStart).empty()) << "said once";
  EXPECT_FALSE(ration.Take("a", kStart)) << "saying it gives nothing back";
}

TEST(LineRation, SilenceGivesABurstBackAndNoMore) {
  LineRation ration(kBurst, 2);
  for (int i = 0; i < 100; ++i) ration.Take("a", kStart);
  ration.TakeLeftOut(kStart + 1h);
  int written = 0;
  for (int i = 0; i < 100; ++i) written += ration.Take("a", kStart + 1h);
  EXPECT_EQ(written, kBurst);
}

TEST(LineRation, AClockThatStandsGivesNothing) {
  LineRation ration(1, 1e9);
  EXPECT_TRUE(ration.Take("a", kStart));
  EXPECT_FALSE(ration.Take("a", kStart - 1s));
}

}  // namespace
}  // namespace stellate::server
