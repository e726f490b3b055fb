// Who is compared with whom, and when a round waits for it.

#include <gtest/gtest.h>

#include "server/oracles/dispatch.h"
#include "tests/server/support/at.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using Accepted = Dispatch::AcceptResult;

using testing::At;

// Time is a number here: no test waits.
class ComparisonsTest : public ::testing::Test {
 protected:
  ComparisonsTest() { options_.answer_limit = 100s; }

  static void AnswerInTime(Dispatch* dispatch, const Lease& lease, TimePoint now) {
    Lease claimed;
    ASSERT_EQ(dispatch->Accept(lease.worker, lease.id, now, &claimed), Accepted::kCounts);
    dispatch->MarkAnswered(claimed.id, claimed.count);
  }

  DispatchOptions options_;
  Lease claimed_;
};

// Of each family of queries, whoever answers all of it.
TEST_F(ComparisonsTest, AWorkerThatComesLateIsComparedBeforeTheRoundEnds) {
  options_.check_share = 0.01;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Join(2, 0);
  const auto answer = [&](const Lease& lease, TimePoint now) {
    const auto result = dispatch.Accept(lease.worker, lease.id, now, &claimed_);
    ASSERT_EQ(result, lease.check ? Accepted::kForComparison : Accepted::kCounts);
    if (!lease.check) dispatch.MarkAnswered(claimed_.id, claimed_.count);
  };
  const auto ask = [&](Dispatch::Family family, TimePoint now, WorkerId wanted) {
    dispatch.Begin({{1, 8, family}}, now);
    const auto leases = dispatch.Assign(now);
    const bool compared = wanted == 0;
    EXPECT_EQ(leases.size(), compared ? 1u : 2u);
    for (const Lease& lease : leases) answer(lease, now + 1ms);
    EXPECT_EQ(dispatch.Done(now + 1ms), compared) << "its answer is not compared yet";
    if (!compared) {
      EXPECT_TRUE(leases.at(1).check);
      EXPECT_EQ(leases.at(1).worker + leases.at(0).worker, wanted);
      dispatch.Compared(leases.at(0).worker, leases.at(1).worker, 0);
    }
    EXPECT_TRUE(dispatch.Done(now + 1ms));
    dispatch.End();
  };
  ask({0, 0}, At(0s), 1 + 2);
  ask({0, 0}, At(1s), 0);
  ask({0, 4}, At(2s), 1 + 2);
  ask({0, 4}, At(3s), 0);
  dispatch.Leave(2, At(4s));
  ask({0, 4}, At(4s), 0);
  dispatch.Join(3, 0);
  // He is asked, or asked to compare, as soon as a question is his.
  dispatch.Begin({{40, 8, {0, 4}}}, At(5s));
  bool compared = false;
  for (auto now = At(5s); !dispatch.Done(now); now += 1ms) {
    ASSERT_LT(now, At(6s));
    for (const Lease& lease : dispatch.Assign(now)) {
      answer(lease, now);
      if (!lease.check) continue;
      compared = true;
      dispatch.Compared(1, 3, 0);
    }
  }
  EXPECT_TRUE(compared);
}

TEST_F(ComparisonsTest, WhoHangsWhileHeComparesHoldsUpNoRoundForLong) {
  options_.check_share = 0.01;
  Dispatch dispatch(options_);
  dispatch.Join(1, 0);
  dispatch.Join(2, 0);
  dispatch.Begin({{1, 8}}, At(0s));
  const auto leases = dispatch.Assign(At(0s));
  ASSERT_EQ(leases.size(), 2u);
  AnswerInTime(&dispatch, leases[0], At(1ms));
  EXPECT_FALSE(dispatch.Done(At(1ms)));
  const TimePoint end = dispatch.NextDeadline();
  EXPECT_LE(end, At(10s));
  EXPECT_TRUE(dispatch.Done(end));
  dispatch.Leave(2, At(2ms));
  EXPECT_TRUE(dispatch.Done(At(2ms))) << "there is nobody to ask";
  dispatch.Join(3, 0);
  EXPECT_FALSE(dispatch.Done(At(3ms)));
  const auto again = dispatch.Assign(At(3ms));
  ASSERT_EQ(again.size(), 1u);
  EXPECT_TRUE(again[0].check);
  EXPECT_EQ(again[0].worker, 3u);
}

}  // namespace
}  // namespace stellate::server
