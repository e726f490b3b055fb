#include "server/oracle_pool.h"

#include <gtest/gtest.h>

#include <future>
#include <limits>

#include "tests/server/fake_worker.h"
#include "tests/server/sphere.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using testing::AnswerSphere;
using testing::FakeWorker;

core::QueryBatch SomeQueries(int n) {
  core::QueryBlock block;
  block.points = Eigen::MatrixXd::Random(3, n);
  block.want_tangents = true;
  core::QueryBatch batch;
  batch.round = 1;
  batch.blocks = {block, block};
  batch.blocks[1].want_tangents = false;
  return batch;
}

class OraclePoolTest : public ::testing::Test {
 protected:
  OraclePoolTest() { options_.chunk_bytes = 4000; }

  // Asks on a thread of its own, as a session does.
  std::future<OraclePool::Outcome> Ask(OraclePool* pool) {
    return std::async(std::launch::async, [this, pool] { return pool->Ask(batch_); });
  }

  void ExpectAllAnswered(const OraclePool::Outcome& outcome) {
    ASSERT_TRUE(outcome.round);
    for (std::size_t b = 0; b < batch_.blocks.size(); ++b) {
      const auto whole = AnswerSphere(batch_.blocks[b], 0, batch_.blocks[b].size());
      EXPECT_EQ(outcome.round->answers.blocks[b].points, whole.points);
      EXPECT_EQ(outcome.round->answers.blocks[b].found, whole.found);
      EXPECT_EQ(outcome.round->answers.blocks[b].tangents, whole.tangents);
    }
  }

  const core::Specification spec_ = testing::SphereSpec(0.1);
  const core::QueryBatch batch_ = SomeQueries(700);
  DispatchOptions options_;
};

TEST_F(OraclePoolTest, AnswersStandWhereTheirQueriesStood) {
  OraclePool pool(spec_, options_, 8);
  const auto a = FakeWorker::Join(&pool);
  const auto b = FakeWorker::Join(&pool);
  const auto c = FakeWorker::Join(&pool);
  ExpectAllAnswered(Ask(&pool).get());
}

TEST_F(OraclePoolTest, AnotherTakesOverWhenAWorkerLeavesInTheMiddle) {
  OraclePool pool(spec_, options_, 8);
  const auto quitter =
      FakeWorker::Join(&pool, [](const Chunk&, core::AnswerBlock*) { return false; });
  auto outcome = Ask(&pool);
  quitter->WaitForChunks(1);
  const auto other = FakeWorker::Join(&pool);
  quitter->Leave();
  ExpectAllAnswered(outcome.get());
  EXPECT_EQ(quitter->answered(), 0);
}

TEST_F(OraclePoolTest, AnotherTakesOverWhenAWorkerIsTooSlow) {
  options_.answer_limit = 50ms;
  OraclePool pool(spec_, options_, 8);
  const auto silent =
      FakeWorker::Join(&pool, [](const Chunk&, core::AnswerBlock*) { return false; });
  auto outcome = Ask(&pool);
  silent->WaitForChunks(1);
  const auto other = FakeWorker::Join(&pool);
  ExpectAllAnswered(outcome.get());
}

TEST_F(OraclePoolTest, AnOracleThatNeverAnswersEndsTheRound) {
  options_.answer_limit = 20ms;
  OraclePool pool(spec_, options_, 8);
  const auto silent =
      FakeWorker::Join(&pool, [](const Chunk&, core::AnswerBlock*) { return false; });
  const auto outcome = Ask(&pool).get();
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->reason, "ANSWER_TIMEOUT");
}

TEST_F(OraclePoolTest, NoWorkerEndsTheRound) {
  options_.worker_wait = 20ms;
  OraclePool pool(spec_, options_, 8);
  const auto outcome = Ask(&pool).get();
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->reason, "NO_WORKER");
}

TEST_F(OraclePoolTest, ABadAnswerEndsTheRoundWithItsOwnReason) {
  OraclePool pool(spec_, options_, 8);
  const auto liar = FakeWorker::Join(&pool, [](const Chunk& chunk, core::AnswerBlock* answer) {
    FakeWorker::AnswerTruly(chunk, answer);
    answer->points(1, 0) = std::numeric_limits<double>::quiet_NaN();
    return true;
  });
  const auto outcome = Ask(&pool).get();
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->reason, "ORACLE_NOT_FINITE");
}

TEST_F(OraclePoolTest, AnInterruptEndsTheWait) {
  OraclePool pool(spec_, options_, 8);
  auto outcome = Ask(&pool);
  pool.Interrupt();
  const auto result = outcome.get();
  EXPECT_FALSE(result.round);
  EXPECT_FALSE(result.failure);
}

TEST_F(OraclePoolTest, WorkersAreCountedAndBounded) {
  OraclePool pool(spec_, options_, 2);
  const auto a = FakeWorker::Join(&pool);
  auto b = FakeWorker::Join(&pool);
  EXPECT_EQ(pool.workers(), 2u);
  EXPECT_EQ(FakeWorker::Join(&pool), nullptr);
  b->Leave();
  EXPECT_NE(FakeWorker::Join(&pool), nullptr);
}

TEST_F(OraclePoolTest, ClosingTellsTheWorkersAndTakesNoMore) {
  OraclePool pool(spec_, options_, 8);
  const auto worker = FakeWorker::Join(&pool);
  pool.Shut();
  EXPECT_EQ(FakeWorker::Join(&pool), nullptr);
  EXPECT_EQ(pool.workers(), 1u) << "who is in may stay until the end";
  pool.Close({});
  worker->WaitForEnd();
  EXPECT_TRUE(worker->end().blame.ok());
  const auto late = pool.Join(worker, 0);
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, core::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace stellate::server
