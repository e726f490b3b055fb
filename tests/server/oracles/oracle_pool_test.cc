#include "server/oracles/oracle_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <future>
#include <limits>
#include <mutex>

#include "tests/server/support/fake_worker.h"
#include "tests/server/support/sphere.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using testing::AnswerSphere;
using testing::FakeWorker;

core::QueryBatch SomeQueries(int n) {
  core::QueryBlock block;
  block.points = Eigen::MatrixXd::Random(3, n);
  block.want.tangents = true;
  core::QueryBatch batch;
  batch.round = 1;
  batch.blocks = {block, block};
  batch.blocks[1].want.tangents = false;
  return batch;
}

class Counts : public PoolObserver {
 public:
  void OnHedged(std::size_t chunks) override { hedged += chunks; }
  void OnCompared(std::size_t queries) override { compared += queries; }
  void OnDisagreement() override { ++disagreements; }

  std::atomic<std::size_t> hedged{0}, compared{0}, disagreements{0};
};

// A worker that answers when the test says so.
class HandWorker : public OracleWorker {
 public:
  explicit HandWorker(std::string title) : title_(std::move(title)) {}

  void Ask(Chunk chunk) override {
    const std::lock_guard lock(mutex_);
    chunks_.push_back(std::move(chunk));
    changed_.notify_all();
  }
  void End(const WorkerEnd&) override {}
  std::string DisplayName() const override { return title_; }

  std::size_t Held() {
    const std::lock_guard lock(mutex_);
    return chunks_.size();
  }
  // Waits for its next chunk.
  Chunk Take() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !chunks_.empty(); });
    Chunk chunk = std::move(chunks_.front());
    chunks_.pop_front();
    return chunk;
  }

 private:
  const std::string title_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Chunk> chunks_;
};

// Of a sphere a tenth larger; each answer is right as such.
bool AnswerForALargerSphere(const Chunk& chunk, core::AnswerBlock* answer) {
  FakeWorker::AnswerTruly(chunk, answer);
  answer->points *= 1.1;
  return true;
}

class OraclePoolTest : public ::testing::Test {
 protected:
  OraclePoolTest() { options_.chunk_bytes = 4000; }

  void TakeAnswer(OraclePool* pool, WorkerId worker, const Chunk& chunk,
                  const FakeWorker::Answer& answer = FakeWorker::AnswerTruly) {
    core::AnswerBlock block;
    answer(chunk, &block);
    const auto claimed = pool->Accept(worker, chunk.lease);
    ASSERT_TRUE(claimed);
    ASSERT_TRUE(*claimed);
    EXPECT_TRUE(pool->Deliver(**claimed, block).ok());
  }

  // Asks on a thread of its own, as a session does.
  std::future<OraclePool::Outcome> Ask(OraclePool* pool) {
    return std::async(std::launch::async, [this, pool] { return pool->Ask(shared_); });
  }

  void ExpectAllAnswered(const OraclePool::Outcome& outcome) {
    ASSERT_TRUE(outcome.round);
    EXPECT_EQ(outcome.round->batch, shared_) << "questions are shared, not copied";
    for (std::size_t b = 0; b < batch_.blocks.size(); ++b) {
      const auto whole = AnswerSphere(batch_.blocks[b], 0, batch_.blocks[b].size());
      EXPECT_EQ(outcome.round->answers.blocks[b].points, whole.points);
      EXPECT_EQ(outcome.round->answers.blocks[b].found, whole.found);
      EXPECT_EQ(outcome.round->answers.blocks[b].tangents, whole.tangents);
    }
  }

  const core::Specification spec_ = testing::SphereSpec(0.1);
  const std::shared_ptr<const core::QueryBatch> shared_ =
      std::make_shared<core::QueryBatch>(SomeQueries(700));
  const core::QueryBatch& batch_ = *shared_;
  DispatchOptions options_;
};

TEST_F(OraclePoolTest, AnswersStandWhereTheirQueriesStood) {
  OraclePool pool(spec_, options_, 8);
  const auto a = FakeWorker::Join(&pool);
  const auto b = FakeWorker::Join(&pool);
  const auto c = FakeWorker::Join(&pool);
  ExpectAllAnswered(Ask(&pool).get());
}

// As many as each block has of them, wherever they stand; a round may need nobody.
TEST_F(OraclePoolTest, WhatIsKnownIsAskedOfNobody) {
  const auto part = [&](std::size_t block, Eigen::Index first, Eigen::Index count) {
    return PartOfRound{block, first, AnswerSphere(batch_.blocks[block], first, count)};
  };
  OraclePool pool(spec_, options_, 8);
  std::mutex mutex;
  std::vector<int> asked(2 * 700, 0), told(2 * 700, 0);
  const auto count = [&](std::vector<int>* which, std::size_t block, Eigen::Index first,
                         Eigen::Index n) {
    const std::lock_guard lock(mutex);
    for (Eigen::Index i = 0; i < n; ++i) ++(*which)[block * 700 + first + i];
  };
  pool.SetOnAnswered([&](const std::shared_ptr<const Round>& round, std::size_t block,
                         Eigen::Index first, Eigen::Index n) {
    EXPECT_EQ(round->answers.blocks[block].points.middleCols(first, n),
              AnswerSphere(batch_.blocks[block], first, n).points);
    count(&told, block, first, n);
  });
  const auto worker = FakeWorker::Join(&pool, [&](const Chunk& chunk, core::AnswerBlock* answer) {
    count(&asked, chunk.block_index, chunk.first, chunk.count);
    return FakeWorker::AnswerTruly(chunk, answer);
  });
  const std::vector<PartOfRound> known = {part(0, 0, 10), part(0, 300, 1), part(0, 301, 99),
                                          part(1, 699, 1)};
  ExpectAllAnswered(pool.Ask(
      shared_, [] {}, known));
  for (std::size_t q = 0; q < asked.size(); ++q) {
    const bool was_known = q < 10 || (q >= 300 && q < 400) || q == 1399;
    EXPECT_EQ(asked[q], was_known ? 0 : 1) << q;
    EXPECT_EQ(told[q], asked[q]) << q;
  }
  worker->Leave();
  ExpectAllAnswered(pool.Ask(shared_, [] {}, {part(0, 0, 700), part(1, 0, 700)}));
}

TEST_F(OraclePoolTest, TheTimeThatWorkersTakeIsUsedOnce) {
  OraclePool pool(spec_, options_, 8);
  int times = 0;
  const auto worker = std::make_shared<HandWorker>("");
  const WorkerId id = *pool.Join(worker, 0);
  const auto answered = pool.Ask(shared_, [&] {
    ++times;
    EXPECT_GT(worker->Held(), 0u) << "the questions are out";
    while (worker->Held() > 0) TakeAnswer(&pool, id, worker->Take());
  });
  EXPECT_EQ(times, 1);
  ExpectAllAnswered(answered);

  pool.Leave(id);
  const auto interrupted = pool.Ask(shared_, [&] {
    ++times;
    pool.Interrupt();
  });
  EXPECT_EQ(times, 2) << "without a worker, too";
  EXPECT_FALSE(interrupted.round);
  EXPECT_FALSE(interrupted.failure);
  EXPECT_FALSE(pool.Ask(shared_, [&] { ++times; }).round);
  EXPECT_EQ(times, 3) << "and where no question goes out any more";
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

// It never answers; with hours of patience the round ends all the same.
TEST_F(OraclePoolTest, AnIdleWorkerAnswersForAStraggler) {
  options_.answer_limit = 10h;
  options_.hedge_unknown = options_.hedge_floor = 1ms;
  const auto counts = std::make_shared<Counts>();
  OraclePool pool(spec_, options_, 8, counts);
  const auto silent =
      FakeWorker::Join(&pool, [](const Chunk&, core::AnswerBlock*) { return false; });
  auto outcome = Ask(&pool);
  silent->WaitForChunks(1);
  const auto other = FakeWorker::Join(&pool);
  ExpectAllAnswered(outcome.get());
  EXPECT_GT(counts->hedged, 0u);
  EXPECT_EQ(counts->disagreements, 0u);
  EXPECT_EQ(silent->answered(), 0);
}

TEST_F(OraclePoolTest, WorkersThatAgreeAreComparedAndLeftInPeace) {
  options_.hedge_unknown = options_.hedge_floor = 1h;
  const auto counts = std::make_shared<Counts>();
  OraclePool pool(spec_, options_, 8, counts);
  const auto a = FakeWorker::Join(&pool);
  const auto b = FakeWorker::Join(&pool);
  ExpectAllAnswered(Ask(&pool).get());
  EXPECT_GT(counts->compared, 0u);
  EXPECT_EQ(counts->disagreements, 0u);
}

TEST_F(OraclePoolTest, TellsWhatEachWorkerDid) {
  options_.hedge_unknown = options_.hedge_floor = 1h;
  options_.check_share = 0;
  OraclePool pool(spec_, options_, 8);
  const auto idle = std::make_shared<HandWorker>("left out");
  const auto busy = std::make_shared<HandWorker>("from the far side");
  const WorkerId first = *pool.Join(busy, 0);
  auto asking = Ask(&pool);
  const Chunk chunk = busy->Take();
  EXPECT_EQ(pool.ListWorkers().at(0).unanswered, static_cast<std::uint64_t>(chunk.count));
  TakeAnswer(&pool, first, chunk);
  const Chunk next = busy->Take();
  pool.Join(idle, 0);
  const std::vector<WorkerStats> workers = pool.ListWorkers();
  ASSERT_EQ(workers.size(), 2u);
  EXPECT_EQ(workers[0].id, first);
  EXPECT_EQ(workers[0].display_name, "from the far side");
  EXPECT_EQ(workers[0].queries, static_cast<std::uint64_t>(chunk.count));
  EXPECT_EQ(workers[0].chunks, 1u);
  EXPECT_EQ(workers[0].newest_chunk, static_cast<std::uint64_t>(next.count));
  EXPECT_GT(workers[0].each_seconds + workers[0].fixed_seconds, 0);
  EXPECT_EQ(workers[1].display_name, "left out");
  EXPECT_EQ(workers[1].queries, 0u);
  EXPECT_EQ(workers[1].each_seconds, 0);
  pool.Interrupt();
  asking.get();
}

TEST_F(OraclePoolTest, WorkersThatServeDifferentManifoldsFailTheRound) {
  options_.hedge_unknown = options_.hedge_floor = 1h;
  for (const bool liar_first : {true, false}) {
    const auto counts = std::make_shared<Counts>();
    OraclePool pool(spec_, options_, 8, counts);
    const auto a = FakeWorker::Join(
        &pool, liar_first ? AnswerForALargerSphere : FakeWorker::Answer(FakeWorker::AnswerTruly));
    const auto b = FakeWorker::Join(
        &pool, liar_first ? FakeWorker::Answer(FakeWorker::AnswerTruly) : AnswerForALargerSphere);
    const auto outcome = Ask(&pool).get();
    ASSERT_TRUE(outcome.failure);
    EXPECT_EQ(outcome.failure->reason, FailureReason::kWorkersDisagree);
    for (const char* part : {"round 1", "block ", "closest_point query ", "worker number 1",
                             "worker number 2", "the distances differ by "}) {
      EXPECT_NE(outcome.failure->message.find(part), std::string::npos)
          << part << " in " << outcome.failure->message;
    }
    EXPECT_GT(counts->disagreements, 0u);
  }
}

// The straggler's answer comes after the other's, while a third worker holds up the round.
TEST_F(OraclePoolTest, AStragglersOwnAnswerIsComparedWithTheOneThatCounts) {
  options_.check_share = 0;
  options_.hedge_unknown = 10h;
  options_.hedge_floor = 0ms;
  options_.hedge_factor = 0;
  const auto counts = std::make_shared<Counts>();
  OraclePool pool(spec_, options_, 8, counts);
  core::QueryBatch batch;
  batch.round = 1;
  batch.blocks.resize(1);
  batch.blocks[0].points = Eigen::MatrixXd::Random(3, 48);
  auto outcome = std::async(std::launch::async,
                            [&] { return pool.Ask(std::make_shared<core::QueryBatch>(batch)); });
  const char* const names[] = {"slow", "quick", "holder"};
  std::vector<std::shared_ptr<HandWorker>> workers;
  std::vector<WorkerId> ids;
  for (const char* name : names) {
    workers.push_back(std::make_shared<HandWorker>(name));
    ids.push_back(*pool.Join(workers.back(), 16));
  }
  // The first may have two of the three chunks: who came later backs it up.
  const Chunk late = workers[0]->Take();
  while (counts->compared == 0) {
    const Chunk chunk = workers[1]->Take();
    TakeAnswer(&pool, ids[1], chunk);
    if (chunk.first != late.first) continue;
    TakeAnswer(&pool, ids[0], late, AnswerForALargerSphere);
    break;
  }
  EXPECT_EQ(counts->compared, static_cast<std::size_t>(late.count));
  const auto result = outcome.get();
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, FailureReason::kWorkersDisagree);
  EXPECT_NE(result.failure->message.find("worker number 1 (slow)"), std::string::npos)
      << result.failure->message;
  EXPECT_NE(result.failure->message.find("worker number 2 (quick)"), std::string::npos);
}

TEST_F(OraclePoolTest, AnOracleThatNeverAnswersEndsTheRound) {
  options_.answer_limit = 20ms;
  OraclePool pool(spec_, options_, 8);
  const auto silent =
      FakeWorker::Join(&pool, [](const Chunk&, core::AnswerBlock*) { return false; });
  const auto outcome = Ask(&pool).get();
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->reason, FailureReason::kAnswerTimeout);
}

TEST_F(OraclePoolTest, NoWorkerEndsTheRound) {
  options_.worker_wait = 20ms;
  OraclePool pool(spec_, options_, 8);
  const auto outcome = Ask(&pool).get();
  ASSERT_TRUE(outcome.failure);
  EXPECT_EQ(outcome.failure->reason, FailureReason::kNoWorker);
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
  EXPECT_EQ(outcome.failure->reason, FailureReason::kOracleNotFinite);
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
