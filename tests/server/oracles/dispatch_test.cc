#include "server/oracles/dispatch.h"

#include <gtest/gtest.h>

#include <map>
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
    ASSERT_EQ(dispatch->Accept(lease.worker, lease.id, now, &claimed),
              Dispatch::AcceptResult::kCounts);
    EXPECT_EQ(claimed.first, lease.first);
    EXPECT_EQ(claimed.count, lease.count);
    dispatch->MarkAnswered(claimed.id, claimed.count);
  }

  // A round of `queries` by workers that take `fixed` for a chunk and `each` for a query. When it
  // ends.
  static TimePoint Mesh(Dispatch* dispatch, Index queries, Clock::duration fixed,
                        Clock::duration each, TimePoint now, int* chunks = nullptr) {
    std::map<WorkerId, TimePoint> free;
    std::multimap<TimePoint, Lease> answers;
    dispatch->Begin({{queries, 8}}, now);
    while (!dispatch->Done(now)) {
      for (const Lease& lease : dispatch->Assign(now)) {
        TimePoint& end = free[lease.worker];
        end = std::max(end, now) + fixed + lease.count * each;
        answers.emplace(end, lease);
        if (chunks != nullptr) ++*chunks;
      }
      if (answers.empty()) {
        ADD_FAILURE() << "nobody is asked";
        break;
      }
      now = answers.begin()->first;
      Answer(dispatch, answers.begin()->second, now);
      answers.erase(answers.begin());
    }
    dispatch->End();
    return now;
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
  while (!dispatch.Done(now)) {
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
  auto now = Mesh(&dispatch, 10, 0s, 1ms, At(0s));
  dispatch.Begin({{100, 8}}, now);
  EXPECT_EQ(dispatch.Assign(now).size(), 2u);
  EXPECT_TRUE(dispatch.Assign(now + 1s).empty());
}

TEST_F(DispatchTest, AWorkerOfUnknownPaceHasOneQueryThenTwoOrEight) {
  Dispatch dear(options_);
  dear.Join(1, 0);
  dear.Begin({{1000, 8}}, At(0s));
  auto leases = dear.Assign(At(0s));
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_EQ(leases[0].count, 1);
  Answer(&dear, leases[0], At(2s));
  leases = dear.Assign(At(2s));
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_EQ(leases[0].count, 2) << "whether it is the query or the chunk that is dear";
  Answer(&dear, leases[0], At(6s));
  for (const Lease& lease : dear.Assign(At(6s))) EXPECT_EQ(lease.count, 1) << "it is the query";

  Dispatch fast(options_);
  fast.Join(1, 0);
  fast.Begin({{1000, 8}}, At(0s));
  leases = fast.Assign(At(0s));
  Answer(&fast, leases.at(0), At(1ms));
  leases = fast.Assign(At(1ms));
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_EQ(leases[0].count, 8);
}

TEST_F(DispatchTest, ChunksKeepToTheWorkersWishAndToBytes) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 5);
  auto now = Mesh(&dispatch, 1000, 0s, 1us, At(0s));
  dispatch.Begin({{1000, 8}}, now);
  for (const Lease& lease : dispatch.Assign(now)) EXPECT_EQ(lease.count, 5);

  Dispatch heavy(options_);
  heavy.Join(1, 0);
  now = Mesh(&heavy, 1000, 0s, 1us, At(0s));
  heavy.Begin({{1000, 300}}, now);
  for (const Lease& lease : heavy.Assign(now)) EXPECT_EQ(lease.count, 3);

  Dispatch giant(options_);  // one query alone is over the limit: it still has to go
  giant.Join(1, 0);
  giant.Begin({{2, 5000}}, At(0s));
  for (const Lease& lease : giant.Assign(At(0s))) EXPECT_EQ(lease.count, 1);
}

TEST_F(DispatchTest, AChunkTakesWhatItShouldHoweverDearAQueryIs) {
  options_.chunk_bytes = 1 << 20;
  for (const auto each : {Clock::duration(10us), Clock::duration(1ms), Clock::duration(20ms),
                          Clock::duration(100ms), Clock::duration(2s)}) {
    Dispatch dispatch(options_);
    dispatch.Join(1, 0);
    auto now = Mesh(&dispatch, 50000, 0s, each, At(0s));
    dispatch.Begin({{1000000, 8}}, now);
    for (const Lease& lease : dispatch.Assign(now)) {
      EXPECT_LE(lease.count * each, std::max(11 * options_.chunk_target / 10, 2 * each));
      EXPECT_GT((lease.count + 1) * each, 9 * options_.chunk_target / 10);
    }
  }
}

TEST_F(DispatchTest, AFixedCostIsAQuarterOfAChunkAtMost) {
  options_.chunk_bytes = 1 << 20;
  for (const auto fixed : {20ms, 100ms, 250ms, 500ms, 2000ms}) {
    for (const auto each : {Clock::duration(0s), Clock::duration(1ms)}) {
      Dispatch dispatch(options_);
      dispatch.Join(1, 0);
      int chunks = 0;
      const auto warm = Mesh(&dispatch, 3000, fixed, each, At(0s), &chunks);
      const auto end = Mesh(&dispatch, 3000, fixed, each, warm, &chunks);
      // Half as long again at most, and a chunk or two at the end.
      EXPECT_LE(end - warm, 3 * (3000 * each) / 2 + 2 * fixed + options_.chunk_target)
          << "fixed " << fixed.count() << " ms, " << chunks << " chunks";
    }
  }
}

TEST_F(DispatchTest, TheEndsOfRoundsDoNotSpoilThePace) {
  options_.chunk_bytes = 1 << 20;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  auto now = Mesh(&dispatch, 3000, 50ms, 1ms, At(0s));
  for (const int queries : {1, 9, 1, 1, 3, 1, 1, 1, 2, 1, 1, 1, 1, 1, 1, 1, 1, 1, 5, 1}) {
    now = Mesh(&dispatch, queries, 50ms, 1ms, now);
  }
  dispatch.Begin({{3000, 8}}, now);
  const auto leases = dispatch.Assign(now);
  EXPECT_NEAR(static_cast<double>(leases.at(0).count), 200, 20);
}

TEST_F(DispatchTest, WhatIsLeftIsSharedAmongTheWorkersButNotInCrumbs) {
  options_.chunk_bytes = 1 << 20;
  Dispatch dear(options_);
  for (WorkerId id = 1; id <= 8; ++id) dear.Join(id, 0);
  auto now = Mesh(&dear, 400, 0s, 20ms, At(0s));
  dear.Begin({{24, 8}}, now);
  auto leases = dear.Assign(now);
  EXPECT_EQ(leases.size(), 8u) << "one each; who is done first has the rest";
  for (const Lease& lease : leases) EXPECT_LE(lease.count, 2);

  Dispatch fast(options_);
  for (WorkerId id = 1; id <= 8; ++id) fast.Join(id, 0);
  now = Mesh(&fast, 100000, 0s, 1us, At(0s));
  fast.Begin({{2000, 8}}, now);
  leases = fast.Assign(now);
  EXPECT_LE(leases.size(), 4u) << "a millisecond's work is not worth eight messages";
}

TEST_F(DispatchTest, WorkOfAWorkerThatLeavesGoesToAnother) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  const auto warm = Mesh(&dispatch, 1000, 0s, 1us, At(0s));
  dispatch.Begin({{20, 8}}, warm);
  const auto before = dispatch.Assign(warm);
  EXPECT_EQ(Queries(before), 20);
  dispatch.Leave(1, At(1s));
  EXPECT_TRUE(dispatch.Assign(At(1s)).empty());
  dispatch.Join(2, 20);
  Index asked = 0;
  std::vector<Lease> after;
  for (auto now = At(2s); !dispatch.Done(now); now += 1ms) {
    for (const Lease& lease : dispatch.Assign(now)) {
      asked += lease.count;
      after.push_back(lease);
      Answer(&dispatch, lease, now);
    }
  }
  EXPECT_EQ(asked, 20);
  for (const Lease& lease : after) {
    EXPECT_EQ(lease.worker, 2u);
    EXPECT_GT(lease.id, before.back().id);
  }
}

TEST_F(DispatchTest, AnswersAfterALeaseRanOutAreLateAndHarmless) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  const auto lost = dispatch.Assign(At(0s));
  ASSERT_EQ(lost.size(), 1u);
  EXPECT_EQ(dispatch.NextDeadline(), At(10s));
  dispatch.Expire(At(10s));
  dispatch.Join(2, 0);
  const auto again = dispatch.Assign(At(10s));
  EXPECT_EQ(Queries(again), 1);
  for (const Lease& lease : again) EXPECT_EQ(lease.worker, 2u) << "a lively worker comes first";
  Lease claimed;
  EXPECT_EQ(dispatch.Accept(1, lost[0].id, At(11s), &claimed), Dispatch::AcceptResult::kLate);
  EXPECT_FALSE(dispatch.Done(At(100s)));
  for (const Lease& lease : again) Answer(&dispatch, lease, At(11s));
  EXPECT_TRUE(dispatch.Done(At(100s)));
}

TEST_F(DispatchTest, LeasesThatWereNeverGivenAreUnknown) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{10, 8}}, At(0s));
  Lease claimed;
  EXPECT_EQ(dispatch.Accept(1, 1, At(0s), &claimed), Dispatch::AcceptResult::kUnknown);
  const auto leases = dispatch.Assign(At(0s));
  EXPECT_EQ(dispatch.Accept(1, 0, At(0s), &claimed), Dispatch::AcceptResult::kUnknown);
  EXPECT_EQ(dispatch.Accept(1, 99, At(0s), &claimed), Dispatch::AcceptResult::kUnknown);
  Answer(&dispatch, leases[0], At(1s));
  EXPECT_EQ(dispatch.Accept(1, leases[0].id, At(1s), &claimed), Dispatch::AcceptResult::kUnknown)
      << "answered twice";
}

TEST_F(DispatchTest, AnOracleThatNeverAnswersFailsAfterThreeLeasesOfOneQuery) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  Mesh(&dispatch, 1000, 0s, 1us, At(0s));
  dispatch.Begin({{8, 8}}, At(1s));
  auto now = At(1s);
  for (const Index asked : {8, 1, 1, 1}) {
    const auto leases = dispatch.Assign(now);
    ASSERT_EQ(leases.size(), 1u);
    EXPECT_EQ(leases[0].count, asked);
    EXPECT_EQ(dispatch.failure(now), Dispatch::Failure::kNone);
    now += 10s;
    dispatch.Expire(now);
  }
  EXPECT_EQ(dispatch.failure(now), Dispatch::Failure::kAnswerTimeout);
}

TEST_F(DispatchTest, AnOracleThatHasBecomeSlowIsTriedWithOneQuery) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  const auto warm = Mesh(&dispatch, 1000, 0s, 1us, At(0s));
  dispatch.Begin({{16, 8}}, At(1s));
  ASSERT_EQ(dispatch.Assign(At(1s)).at(0).count, 16) << (warm - At(0s)).count();
  auto now = At(11s);
  dispatch.Expire(now);
  auto again = dispatch.Assign(now);
  ASSERT_EQ(again.size(), 1u) << "one at a time for a worker that let a lease run out";
  EXPECT_EQ(again[0].count, 1);
  // Nine seconds for each: it has to be meshed.
  while (!dispatch.Done(now)) {
    ASSERT_FALSE(again.empty());
    for (const Lease& lease : again) {
      now += 9s * lease.count;
      dispatch.Expire(now);
      Answer(&dispatch, lease, now);
    }
    again = dispatch.Assign(now);
  }
  EXPECT_EQ(dispatch.failure(now), Dispatch::Failure::kNone);
}

TEST_F(DispatchTest, AWorkerThatSaysItIsBusyKeepsItsLeaseForAWhile) {
  options_.busy_limit = 60s;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  auto lease = dispatch.Assign(At(0s)).at(0);
  for (auto now = At(8s); now < At(60s); now += 8s) {
    dispatch.Expire(now);
    dispatch.Busy(1, lease.id, now);
    dispatch.Busy(1, lease.id + 1, now);  // not given
    dispatch.Busy(2, lease.id, now);      // not there
    EXPECT_EQ(dispatch.NextDeadline(), std::min(now + 10s, At(60s)));
  }
  dispatch.Expire(At(59s));
  EXPECT_TRUE(dispatch.Assign(At(59s)).empty());
  dispatch.Expire(At(60s));  // said so at 56 s and may take 60 s in all
  lease = dispatch.Assign(At(60s)).at(0);
  EXPECT_EQ(dispatch.failure(At(60s)), Dispatch::Failure::kNone);
  dispatch.Busy(1, lease.id, At(69s));
  dispatch.Expire(At(78s));
  Answer(&dispatch, lease, At(78s));
  EXPECT_TRUE(dispatch.Done(At(100s)));
}

TEST_F(DispatchTest, AHungOracleThatSaysItIsBusyFailsAfterThreeTimesTheLimit) {
  options_.busy_limit = 60s;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  LeaseId lease = 0;
  auto now = At(0s);
  for (; dispatch.failure(now) == Dispatch::Failure::kNone && now < At(1000s); now += 5s) {
    for (const Lease& given : dispatch.Assign(now)) lease = given.id;
    dispatch.Busy(1, lease, now);
    dispatch.Expire(now);
  }
  EXPECT_EQ(dispatch.failure(now), Dispatch::Failure::kAnswerTimeout);
  EXPECT_LE(now, At(200s));
}

TEST_F(DispatchTest, ChunksInAWorkersQueueDoNotAge) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 4);
  Mesh(&dispatch, 100, 0s, 1us, At(0s));
  dispatch.Begin({{8, 8}}, At(1s));
  const auto leases = dispatch.Assign(At(1s));
  ASSERT_EQ(leases.size(), 2u);
  Answer(&dispatch, leases[0], At(10s));
  dispatch.Expire(At(13s));  // the second had 3 s of its own
  Answer(&dispatch, leases[1], At(16s));
  EXPECT_TRUE(dispatch.Done(At(100s)));
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
  dispatch.Begin({{1, 8}}, At(0s));
  const auto old = dispatch.Assign(At(0s));
  dispatch.End();
  dispatch.Begin({{1, 8}}, At(1s));
  const auto fresh = dispatch.Assign(At(1s));
  Lease claimed;
  EXPECT_EQ(dispatch.Accept(1, old[0].id, At(1s), &claimed), Dispatch::AcceptResult::kLate);
  Answer(&dispatch, fresh[0], At(2s));
  EXPECT_TRUE(dispatch.Done(At(100s)));
}

}  // namespace
}  // namespace stellate::server
