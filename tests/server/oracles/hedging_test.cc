// Stragglers that idle workers back up, and queries that two workers answer.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "server/oracles/dispatch.h"
#include "tests/server/support/at.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using Accepted = Dispatch::AcceptResult;
using Eigen::Index;

using testing::At;

// Time is a number here: no test waits.
class HedgingTest : public ::testing::Test {
 protected:
  HedgingTest() {
    options_.answer_limit = 100s;
    options_.check_share = 0;
  }

  // Two workers have a query each; the second has answered, in one second.
  void BeginWithOneLate(Dispatch* dispatch) {
    dispatch->Join(1, 10);
    dispatch->Join(2, 10);
    dispatch->Begin({{2, 8}}, At(0s));
    const auto leases = dispatch->Assign(At(0s));
    ASSERT_EQ(leases.size(), 2u);
    ASSERT_EQ(leases[0].worker, 1u);
    late_ = leases[0];
    AnswerInTime(dispatch, leases[1], At(1s));
    EXPECT_TRUE(dispatch->Assign(At(1s)).empty()) << "nothing is overdue yet";
  }

  static void AnswerInTime(Dispatch* dispatch, const Lease& lease, TimePoint now) {
    Lease claimed;
    ASSERT_EQ(dispatch->Accept(lease.worker, lease.id, now, &claimed), Accepted::kCounts);
    dispatch->MarkAnswered(claimed.id, claimed.count);
  }

  DispatchOptions options_;
  Lease late_, claimed_;
};

TEST_F(HedgingTest, AnIdleWorkerIsGivenWhatIsFarOverdueAndTheFirstAnswerCounts) {
  Dispatch dispatch(options_);
  BeginWithOneLate(&dispatch);
  // A query a second is the only pace known, and three times that time is patience enough.
  EXPECT_EQ(dispatch.NextDeadline(), At(3s));
  EXPECT_TRUE(dispatch.Assign(At(2999ms)).empty());
  const auto hedge = dispatch.Assign(At(3s));
  ASSERT_EQ(hedge.size(), 1u);
  EXPECT_EQ(hedge[0].worker, 2u);
  EXPECT_EQ(hedge[0].twin, late_.id);
  EXPECT_EQ(hedge[0].block, late_.block);
  EXPECT_EQ(hedge[0].first, late_.first);
  EXPECT_EQ(hedge[0].count, late_.count);
  EXPECT_TRUE(dispatch.Assign(At(50s)).empty()) << "two are enough";
  AnswerInTime(&dispatch, hedge[0], At(4s));
  EXPECT_TRUE(dispatch.Done(At(100s)));
  EXPECT_EQ(dispatch.Accept(1, late_.id, At(5s), &claimed_), Accepted::kForComparison);
  EXPECT_EQ(claimed_.first, late_.first);
  EXPECT_EQ(claimed_.count, late_.count);
  EXPECT_EQ(dispatch.Accept(1, late_.id, At(5s), &claimed_), Accepted::kUnknown) << "twice";
}

TEST_F(HedgingTest, WhoSaysItIsBusyIsBackedUpAsWell) {
  Dispatch dispatch(options_);
  BeginWithOneLate(&dispatch);
  dispatch.Busy(1, late_.id, At(2s));
  const auto hedge = dispatch.Assign(At(3s));
  ASSERT_EQ(hedge.size(), 1u);
  EXPECT_EQ(hedge[0].twin, late_.id);
}

TEST_F(HedgingTest, TheStragglerMayBeTheFirst) {
  Dispatch dispatch(options_);
  BeginWithOneLate(&dispatch);
  const auto hedge = dispatch.Assign(At(3s));
  ASSERT_EQ(hedge.size(), 1u);
  AnswerInTime(&dispatch, late_, At(4s));
  EXPECT_TRUE(dispatch.Done(At(100s)));
  EXPECT_EQ(dispatch.Accept(2, hedge[0].id, At(5s), &claimed_), Accepted::kForComparison);
}

TEST_F(HedgingTest, AnAnswerAfterTheRoundIsLate) {
  Dispatch dispatch(options_);
  BeginWithOneLate(&dispatch);
  AnswerInTime(&dispatch, dispatch.Assign(At(3s)).at(0), At(4s));
  dispatch.End();
  dispatch.Begin({{20, 8}}, At(4s));
  EXPECT_EQ(dispatch.Accept(1, late_.id, At(5s), &claimed_), Accepted::kLate);
  EXPECT_EQ(dispatch.unanswered(), 20);
}

TEST_F(HedgingTest, WhoeverOfTheTwoLeavesTheOtherHasItAlone) {
  Dispatch gone(options_);
  BeginWithOneLate(&gone);
  const auto hedge = gone.Assign(At(3s));
  gone.Leave(1, At(4s));
  EXPECT_TRUE(gone.Assign(At(4s)).empty()) << "worker 2 has it";
  AnswerInTime(&gone, hedge.at(0), At(5s));
  EXPECT_TRUE(gone.Done(At(100s)));

  Dispatch again(options_);
  BeginWithOneLate(&again);
  ASSERT_EQ(again.Assign(At(3s)).size(), 1u);
  again.Leave(2, At(4s));
  again.Join(3, 0);
  const auto second = again.Assign(At(4s));
  ASSERT_EQ(second.size(), 1u) << "worker 1 is as late as before";
  EXPECT_EQ(second[0].worker, 3u);
  EXPECT_EQ(second[0].twin, late_.id);
}

TEST_F(HedgingTest, ALeaseThatRunsOutIsNotGivenOutAThirdTime) {
  Dispatch dispatch(options_);
  BeginWithOneLate(&dispatch);
  const auto hedge = dispatch.Assign(At(3s));
  dispatch.Expire(At(100s));
  EXPECT_TRUE(dispatch.Assign(At(100s)).empty());
  EXPECT_EQ(dispatch.failure(At(100s)), Dispatch::Failure::kNone);
  AnswerInTime(&dispatch, hedge.at(0), At(101s));
  EXPECT_TRUE(dispatch.Done(At(100s)));
  EXPECT_EQ(dispatch.Accept(1, late_.id, At(102s), &claimed_), Accepted::kLate);
}

TEST_F(HedgingTest, WhoHasNotFinishedAnOldChunkIsAskedLast) {
  Dispatch dispatch(options_);
  BeginWithOneLate(&dispatch);
  AnswerInTime(&dispatch, dispatch.Assign(At(3s)).at(0), At(4s));
  dispatch.End();
  dispatch.Begin({{100, 8}}, At(4s));
  for (const Lease& lease : dispatch.Assign(At(4s))) EXPECT_EQ(lease.worker, 2u);
  EXPECT_EQ(dispatch.Accept(1, late_.id, At(5s), &claimed_), Accepted::kLate);
  const auto leases = dispatch.Assign(At(5s));
  ASSERT_FALSE(leases.empty()) << "it has finished";
  for (const Lease& lease : leases) EXPECT_EQ(lease.worker, 1u);
}

TEST_F(HedgingTest, WithoutAnySpeedPatienceIsFixed) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  ASSERT_EQ(dispatch.Assign(At(0s)).size(), 1u);
  EXPECT_EQ(dispatch.NextDeadline(), At(100s)) << "nobody is idle";
  dispatch.Join(2, 0);
  EXPECT_EQ(dispatch.NextDeadline(), At(options_.hedge_unknown));
  EXPECT_TRUE(dispatch.Assign(At(options_.hedge_unknown - 1ns)).empty());
  EXPECT_EQ(dispatch.Assign(At(options_.hedge_unknown)).size(), 1u);
}

TEST_F(HedgingTest, ShortChunksHaveTheFloorAndLongWaysTheirRoundTrip) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  AnswerInTime(&dispatch, dispatch.Assign(At(0s)).at(0), At(1ms));
  dispatch.End();
  dispatch.Begin({{8, 8}}, At(1s));
  ASSERT_EQ(dispatch.Assign(At(1s)).size(), 1u);
  dispatch.Join(2, 0);
  EXPECT_EQ(dispatch.NextDeadline(), At(1s + options_.hedge_floor));

  Dispatch far(options_);  // one query takes as long as two: it is the way
  far.Join(1, 0);
  far.Begin({{3, 8}}, At(0s));
  AnswerInTime(&far, far.Assign(At(0s)).at(0), At(400ms));
  AnswerInTime(&far, far.Assign(At(400ms)).at(0), At(800ms));
  far.End();
  far.Begin({{1, 8}}, At(1s));
  ASSERT_EQ(far.Assign(At(1s)).size(), 1u);
  far.Join(2, 0);
  EXPECT_GT(far.NextDeadline(), At(2s));
  EXPECT_LE(far.NextDeadline(), At(2200ms));
}

TEST_F(HedgingTest, NobodyIsGivenMoreThanItWishesFor) {
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  AnswerInTime(&dispatch, dispatch.Assign(At(0s)).at(0), At(1ms));
  dispatch.End();
  dispatch.Begin({{8, 8}}, At(1s));
  ASSERT_EQ(dispatch.Assign(At(1s)).at(0).count, 8);
  dispatch.Join(2, 7);
  EXPECT_TRUE(dispatch.Assign(At(50s)).empty());
  EXPECT_EQ(dispatch.NextDeadline(), At(101s)) << "or the caller would spin";
}

TEST_F(HedgingTest, AFewQueriesAreAskedOfTwo) {
  options_.check_share = 0.01;
  options_.chunk_bytes = 1 << 20;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Join(2, 0);
  dispatch.Begin({{100000, 8}}, At(0s));
  auto now = At(0s);
  std::map<WorkerId, Index> checked, answered;
  std::map<WorkerId, std::vector<Lease>> given;
  std::vector<Lease> open;
  while (!dispatch.Done(now)) {
    for (const Lease& lease : dispatch.Assign(now)) open.push_back(lease);
    ASSERT_FALSE(open.empty());
    const Lease lease = open.front();
    open.erase(open.begin());
    now += 1ms;
    const auto result = dispatch.Accept(lease.worker, lease.id, now, &claimed_);
    if (lease.check) {
      EXPECT_EQ(result, Accepted::kForComparison);
      checked[lease.worker] += lease.count;
      dispatch.Compared(lease.worker, 3 - lease.worker, 0);
      const auto& theirs = given[3 - lease.worker];
      EXPECT_TRUE(std::any_of(theirs.begin(), theirs.end(), [&](const Lease& other) {
        return other.first <= lease.first && lease.first + lease.count <= other.first + other.count;
      })) << "of the other's queries";
    } else {
      ASSERT_EQ(result, Accepted::kCounts);
      answered[lease.worker] += lease.count;
      given[lease.worker].push_back(lease);
      dispatch.MarkAnswered(claimed_.id, claimed_.count);
    }
  }
  EXPECT_EQ(answered[1] + answered[2], 100000);
  EXPECT_GE(checked[1] + checked[2], 8);
  for (const WorkerId id : {1, 2}) {
    EXPECT_LE(static_cast<double>(checked[id]), 8 + 0.01 * static_cast<double>(answered[id]));
  }
}

TEST_F(HedgingTest, ACheckComesBeforeTheFirstChunkAndNotToOneAlone) {
  options_.check_share = 0.01;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  auto leases = dispatch.Assign(At(0s));
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_FALSE(leases[0].check);
  AnswerInTime(&dispatch, leases[0], At(1ms));
  dispatch.End();

  dispatch.Join(2, 0);
  dispatch.Begin({{9, 8}}, At(2s));
  leases = dispatch.Assign(At(2s));
  ASSERT_EQ(leases.size(), 3u);
  EXPECT_FALSE(leases[0].check);
  EXPECT_TRUE(leases[1].check);
  EXPECT_EQ(leases[1].count, std::min<Index>(leases[0].count, 8));
  EXPECT_NE(leases[1].worker, leases[0].worker);
  EXPECT_FALSE(leases[2].check);
  EXPECT_EQ(leases[2].worker, leases[1].worker);
}

// Workers join, leave, answer late, never or out of order, for hundreds of rounds.
TEST_F(HedgingTest, HoweverWorkersBehaveEveryQueryCountsOnce) {
  options_.check_share = 0.05;
  options_.answer_limit = 2s;
  options_.max_leases = 1000;
  std::mt19937 random(11);
  const auto below = [&random](unsigned n) { return random() % n; };
  std::size_t hedged = 0, seconds = 0;
  Dispatch dispatch(options_);
  WorkerId next_worker = 1;
  std::set<WorkerId> workers;
  std::vector<Lease> open;
  auto now = At(0s);
  for (int round = 0; round < 300; ++round) {
    const Index n = 1 + below(400);
    std::vector<int> counted(static_cast<std::size_t>(n));
    std::vector<WorkerId> by(static_cast<std::size_t>(n));
    std::vector<Lease> to_compare;
    dispatch.Begin({{n, 8}}, now);
    while (!dispatch.Done(now)) {
      now += std::chrono::milliseconds(below(300));
      if (workers.size() < 2 || (below(20) == 0 && workers.size() < 6)) {
        dispatch.Join(next_worker, below(3) == 0 ? 1 + below(30) : 0);
        workers.insert(next_worker++);
      }
      if (workers.size() > 2 && below(25) == 0) {
        const WorkerId leaver = *std::next(workers.begin(), below(workers.size()));
        dispatch.Leave(leaver, now);
        workers.erase(leaver);
        std::erase_if(open, [leaver](const Lease& l) { return l.worker == leaver; });
      }
      dispatch.Expire(now);
      ASSERT_EQ(dispatch.failure(now), Dispatch::Failure::kNone);
      for (const Lease& lease : dispatch.Assign(now)) {
        EXPECT_TRUE(workers.contains(lease.worker));
        hedged += lease.twin != 0 ? 1 : 0;
        open.push_back(lease);
      }
      ASSERT_TRUE(dispatch.NextDeadline() > now || workers.empty() || dispatch.Done(now));
      for (int answers = below(3); answers > 0 && !open.empty(); --answers) {
        const std::size_t which = below(4) == 0 ? below(open.size()) : 0;
        const Lease lease = open[which];
        open.erase(open.begin() + static_cast<std::ptrdiff_t>(which));
        switch (dispatch.Accept(lease.worker, lease.id, now, &claimed_)) {
          case Accepted::kCounts:
            EXPECT_FALSE(claimed_.check);
            for (Index i = 0; i < claimed_.count; ++i) {
              ++counted[static_cast<std::size_t>(claimed_.first + i)];
              by[static_cast<std::size_t>(claimed_.first + i)] = lease.worker;
            }
            dispatch.MarkAnswered(claimed_.id, claimed_.count);
            break;
          case Accepted::kForComparison:
            ++seconds;
            to_compare.push_back(claimed_);
            break;
          case Accepted::kLate:
            break;
          case Accepted::kUnknown:
            FAIL() << "it was given and is answered once";
        }
      }
      std::erase_if(to_compare, [&](const Lease& second) {
        const WorkerId other = by[static_cast<std::size_t>(second.first)];
        if (other != 0 && other != second.worker) dispatch.Compared(second.worker, other, 0);
        return other != 0;
      });
    }
    for (const int times : counted) ASSERT_EQ(times, 1) << "round " << round;
    dispatch.End();
  }
  EXPECT_GT(hedged, 50u);
  EXPECT_GT(seconds, 100u);
}

}  // namespace
}  // namespace stellate::server
