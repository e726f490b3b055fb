#include "server/dispatch.h"

#include <gtest/gtest.h>

#include <numeric>

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using Eigen::Index;

// Time is a number here: no test waits.
class DispatchTest : public ::testing::Test {
 protected:
  DispatchTest() {
    options_.answer_limit = 10s;
    options_.worker_wait = 20s;
    options_.chunk_bytes = 1000;
    options_.check_share = 0;
  }

  static TimePoint At(Clock::duration since) { return TimePoint{} + since; }

  static Index Queries(const std::vector<Lease>& leases) {
    return std::accumulate(leases.begin(), leases.end(), Index{0},
                           [](Index n, const Lease& lease) { return n + lease.count; });
  }

  static void Answer(Dispatch* dispatch, const Lease& lease, TimePoint now) {
    Lease claimed;
    ASSERT_EQ(dispatch->Claim(lease.worker, lease.id, now, &claimed),
              Dispatch::ClaimResult::kClaimed);
    EXPECT_EQ(claimed.first, lease.first);
    EXPECT_EQ(claimed.count, lease.count);
    dispatch->Settle(claimed);
  }

  DispatchOptions options_;
};

TEST_F(DispatchTest, EveryQueryIsAnsweredOnce) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Join(2, 7);
  dispatch.Begin({{500, 8}, {0, 8}, {33, 80}}, At(0s));
  std::vector<std::vector<int>> seen = {std::vector<int>(500), {}, std::vector<int>(33)};
  auto now = At(0s);
  std::vector<Lease> open;
  while (!dispatch.Done()) {
    for (const Lease& lease : dispatch.Assign(now)) open.push_back(lease);
    ASSERT_FALSE(open.empty());
    now += 1ms;
    const Lease lease = open.back();  // newest first: order does not matter
    open.pop_back();
    for (Index i = 0; i < lease.count; ++i) ++seen[lease.block][lease.first + i];
    Answer(&dispatch, lease, now);
  }
  for (const auto& block : seen) {
    for (const int times : block) EXPECT_EQ(times, 1);
  }
}

TEST_F(DispatchTest, AWorkerHoldsAFewChunksAtMost) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 1);
  dispatch.Begin({{100, 8}}, At(0s));
  EXPECT_EQ(dispatch.Assign(At(0s)).size(), 2u);
  EXPECT_TRUE(dispatch.Assign(At(1s)).empty());
}

TEST_F(DispatchTest, ChunksKeepToTheWorkersWishAndToBytes) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 5);
  dispatch.Begin({{1000, 8}}, At(0s));
  for (const Lease& lease : dispatch.Assign(At(0s))) EXPECT_LE(lease.count, 5);

  Dispatch heavy(options_);
  heavy.Join(1, 0);
  heavy.Begin({{1000, 300}}, At(0s));
  for (const Lease& lease : heavy.Assign(At(0s))) EXPECT_EQ(lease.count, 3);

  Dispatch giant(options_);  // one query alone is over the limit: it still has to go
  giant.Join(1, 0);
  giant.Begin({{2, 5000}}, At(0s));
  for (const Lease& lease : giant.Assign(At(0s))) EXPECT_EQ(lease.count, 1);
}

TEST_F(DispatchTest, ChunksGrowAndShrinkWithTheMeasuredSpeed) {
  options_.chunk_bytes = 1 << 20;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{100000, 8}}, At(0s));
  auto leases = dispatch.Assign(At(0s));
  const Index first = leases[0].count;
  Answer(&dispatch, leases[0], At(1ms));  // fast
  leases = dispatch.Assign(At(1ms));
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_GT(leases[0].count, 10 * first);

  Dispatch dear(options_);
  dear.Join(1, 0);
  dear.Begin({{100000, 8}}, At(0s));
  leases = dear.Assign(At(0s));
  Answer(&dear, leases[0], At(8s));  // 8 queries a second
  leases = dear.Assign(At(8s));
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_LT(leases[0].count, first);
  EXPECT_GE(leases[0].count, 1);
}

TEST_F(DispatchTest, WorkOfAWorkerThatLeavesGoesToAnother) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{20, 8}}, At(0s));
  const auto before = dispatch.Assign(At(0s));
  EXPECT_EQ(Queries(before), 20);
  dispatch.Leave(1, At(1s));
  EXPECT_TRUE(dispatch.Assign(At(1s)).empty());
  dispatch.Join(2, 0);
  const auto after = dispatch.Assign(At(2s));
  EXPECT_EQ(Queries(after), 20);
  for (const Lease& lease : after) {
    EXPECT_EQ(lease.worker, 2u);
    EXPECT_GT(lease.id, before.back().id);
    Answer(&dispatch, lease, At(3s));
  }
  EXPECT_TRUE(dispatch.Done());
}

TEST_F(DispatchTest, AnswersAfterALeaseRanOutAreLateAndHarmless) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{10, 8}}, At(0s));
  const auto lost = dispatch.Assign(At(0s));
  ASSERT_EQ(lost.size(), 1u);
  EXPECT_EQ(dispatch.NextDeadline(), At(10s));
  dispatch.Expire(At(10s));
  dispatch.Join(2, 0);
  const auto again = dispatch.Assign(At(10s));
  EXPECT_EQ(Queries(again), 10);
  for (const Lease& lease : again) EXPECT_EQ(lease.worker, 2u) << "a lively worker comes first";
  Lease claimed;
  EXPECT_EQ(dispatch.Claim(1, lost[0].id, At(11s), &claimed), Dispatch::ClaimResult::kLate);
  EXPECT_FALSE(dispatch.Done());
  for (const Lease& lease : again) Answer(&dispatch, lease, At(11s));
  EXPECT_TRUE(dispatch.Done());
}

TEST_F(DispatchTest, LeasesThatWereNeverGivenAreUnknown) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{10, 8}}, At(0s));
  Lease claimed;
  EXPECT_EQ(dispatch.Claim(1, 1, At(0s), &claimed), Dispatch::ClaimResult::kUnknown);
  const auto leases = dispatch.Assign(At(0s));
  EXPECT_EQ(dispatch.Claim(1, 0, At(0s), &claimed), Dispatch::ClaimResult::kUnknown);
  EXPECT_EQ(dispatch.Claim(1, 99, At(0s), &claimed), Dispatch::ClaimResult::kUnknown);
  Answer(&dispatch, leases[0], At(1s));
  EXPECT_EQ(dispatch.Claim(1, leases[0].id, At(1s), &claimed), Dispatch::ClaimResult::kUnknown)
      << "answered twice";
}

TEST_F(DispatchTest, AnOracleThatNeverAnswersFailsAfterThreeLeases) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{8, 8}}, At(0s));
  auto now = At(0s);
  for (int timeout = 1; timeout <= 3; ++timeout) {
    ASSERT_FALSE(dispatch.Assign(now).empty());
    EXPECT_EQ(dispatch.failure(now), Dispatch::Failure::kNone);
    now += 10s;
    dispatch.Expire(now);
  }
  EXPECT_EQ(dispatch.failure(now), Dispatch::Failure::kAnswerTimeout);
}

TEST_F(DispatchTest, ASlowOracleIsTriedWithHalfTheChunk) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{16, 8}}, At(0s));
  ASSERT_EQ(dispatch.Assign(At(0s)).at(0).count, 16);
  dispatch.Expire(At(10s));
  const auto again = dispatch.Assign(At(10s));
  ASSERT_EQ(again.size(), 1u) << "one at a time for a worker that let a lease run out";
  EXPECT_EQ(again[0].count, 8);
}

TEST_F(DispatchTest, ChunksInAWorkersQueueDoNotAge) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 4);
  dispatch.Begin({{8, 8}}, At(0s));
  const auto leases = dispatch.Assign(At(0s));
  ASSERT_EQ(leases.size(), 2u);
  Answer(&dispatch, leases[0], At(9s));
  dispatch.Expire(At(12s));  // the second had 3 s of its own
  Answer(&dispatch, leases[1], At(15s));
  EXPECT_TRUE(dispatch.Done());
}

TEST_F(DispatchTest, WithoutAWorkerTheRoundFailsAfterTheWait) {
  Dispatch dispatch(options_);
  dispatch.Begin({{8, 8}}, At(0s));
  EXPECT_EQ(dispatch.NextDeadline(), At(20s));
  EXPECT_EQ(dispatch.failure(At(19s)), Dispatch::Failure::kNone);
  dispatch.Join(1, 0);
  EXPECT_EQ(dispatch.failure(At(25s)), Dispatch::Failure::kNone);
  dispatch.Leave(1, At(30s));
  EXPECT_EQ(dispatch.failure(At(49s)), Dispatch::Failure::kNone);
  EXPECT_EQ(dispatch.failure(At(50s)), Dispatch::Failure::kNoWorker);
}

TEST_F(DispatchTest, ManyWorkersShareARound) {
  Dispatch dispatch(options_);
  for (WorkerId id = 1; id <= 4; ++id) dispatch.Join(id, 0);
  dispatch.Begin({{400, 8}}, At(0s));
  std::vector<Index> share(5);
  for (const Lease& lease : dispatch.Assign(At(0s))) share[lease.worker] += lease.count;
  for (WorkerId id = 1; id <= 4; ++id) EXPECT_GT(share[id], 0) << "worker " << id;
}

TEST_F(DispatchTest, LeasesOfAnEarlierRoundAreLate) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{4, 8}}, At(0s));
  const auto old = dispatch.Assign(At(0s));
  dispatch.End();
  dispatch.Begin({{4, 8}}, At(1s));
  const auto fresh = dispatch.Assign(At(1s));
  Lease claimed;
  EXPECT_EQ(dispatch.Claim(1, old[0].id, At(1s), &claimed), Dispatch::ClaimResult::kLate);
  Answer(&dispatch, fresh[0], At(2s));
  EXPECT_TRUE(dispatch.Done());
}

}  // namespace
}  // namespace stellate::server
