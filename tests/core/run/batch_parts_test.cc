// Batches cut to a client's limit: the same mesh, in more round trips.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::AnswererFor;
using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::NewMesher;
using testing::SpecificationFor;

struct PartsCase {
  std::uint64_t most;
  bool ahead, tangents;
};

class PartsOfBatches : public ::testing::TestWithParam<PartsCase> {};

TEST_P(PartsOfBatches, NeverExceedTheLimitNorChangeTheMesh) {
  const auto torus = Make("torus");
  Specification spec = SpecificationFor(*torus, 0.15);
  spec.criteria.speculative = GetParam().ahead;
  spec.oracle.tangent_basis = GetParam().tangents;
  const DrivenRun whole = Drive(spec, *torus);
  spec.limits.max_batch_queries = GetParam().most;
  Eigen::Index largest = 0;
  std::uint64_t last_round = 0;
  const DrivenRun cut = Drive(spec, [&](const QueryBatch& batch) {
    largest = std::max(largest, batch.size());
    EXPECT_EQ(batch.round, ++last_round);
    return testing::AnswersOf(*torus, batch);
  });
  EXPECT_LE(largest, static_cast<Eigen::Index>(GetParam().most));
  EXPECT_EQ(cut.report().termination, Termination::kConverged);
  EXPECT_EQ(cut.mesher->Points(), whole.mesher->Points());
  EXPECT_EQ(cut.mesher->Tangents(), whole.mesher->Tangents());
  EXPECT_EQ(cut.mesher->Simplices(), whole.mesher->Simplices());
  EXPECT_EQ(cut.report().counts.queries, whole.report().counts.queries);
  EXPECT_EQ(cut.report().certificate.verdict, whole.report().certificate.verdict);
  EXPECT_GT(cut.report().counts.rounds, whole.report().counts.rounds);
  EXPECT_EQ(cut.report().counts.rounds, cut.deltas.size());
}

INSTANTIATE_TEST_SUITE_P(Limits, PartsOfBatches,
                         ::testing::Values(PartsCase{64, false, true}, PartsCase{64, true, true},
                                           PartsCase{37, true, false},
                                           PartsCase{1000, true, true}));

// A refused answer to a part leaves all as it was: the part can be answered again.
TEST(PartsOfBatches, AreAskedAgainAfterARefusal) {
  const auto torus = Make("torus");
  Specification spec = SpecificationFor(*torus, 0.2);
  spec.oracle.intersect_flat = false;  // every answer is found, so each is looked at
  const DrivenRun good = Drive(spec, *torus);
  spec.limits.max_batch_queries = 50;
  const auto mesher = NewMesher(spec);
  const auto answer = AnswererFor(*torus);
  while (const auto batch = mesher->NextBatch()) {
    Answers answers = answer(*batch);
    Answers wrong = answers;
    wrong.blocks.front().points(0, 0) = std::numeric_limits<double>::quiet_NaN();
    const std::uint64_t round = batch->round;
    ASSERT_FALSE(mesher->Absorb(wrong));
    ASSERT_EQ(mesher->NextBatch()->round, round);
    ASSERT_TRUE(mesher->Absorb(answers));
  }
  EXPECT_EQ(mesher->Points(), good.mesher->Points());
}

TEST(PartsOfBatches, CountAsRoundsOfTheBudget) {
  const auto torus = Make("torus");
  Specification spec = SpecificationFor(*torus, 0.2);
  spec.limits.max_batch_queries = 10;
  spec.limits.max_rounds = 3;
  const DrivenRun run = Drive(spec, *torus);
  EXPECT_EQ(run.report().termination, Termination::kRoundBudget);
  EXPECT_EQ(run.report().counts.rounds, 3u);
}

}  // namespace
}  // namespace stellate::core
