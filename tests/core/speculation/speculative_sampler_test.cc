// Speculative sampling: the sample is grown on a surrogate, and queried in one batch.

#include "core/speculation/speculative_sampler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "tests/core/support/in_process_run.h"
#include "tests/core/support/point_hash.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::ExpectGoodMesh;
using testing::Make;
using testing::SameMesh;
using testing::SpecificationFor;

Specification AheadOn(const Manifold& manifold, double epsilon) {
  Specification spec = SpecificationFor(manifold, epsilon);
  spec.criteria.speculative = true;
  return spec;
}

struct Case {
  const char* manifold;
  double epsilon;
  std::uint64_t most_rounds;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.manifold << " epsilon " << c.epsilon; }

class SpeculativeSample : public ::testing::TestWithParam<Case> {};

TEST_P(SpeculativeSample, TakesAHandfulOfRoundsAndHardlyMoreVertices) {
  const auto manifold = Make(GetParam().manifold);
  Specification spec = AheadOn(*manifold, GetParam().epsilon);
  const DrivenRun ahead = Drive(spec, *manifold);
  spec.criteria.speculative = false;
  const DrivenRun plain = Drive(spec, *manifold);
  ExpectGoodMesh(ahead, manifold->facts());
  const Counts& a = ahead.report().counts;
  const Counts& p = plain.report().counts;
  EXPECT_LE(a.rounds, GetParam().most_rounds);
  EXPECT_LT(2 * a.rounds, p.rounds);
  EXPECT_LT(static_cast<double>(a.vertices), 1.05 * static_cast<double>(p.vertices));
  EXPECT_GT(ahead.report().certificate.min_fatness, 0.6 * plain.report().certificate.min_fatness);
  // Most of it comes at once, and has no simplices before.
  const auto largest = std::ranges::max_element(
      ahead.deltas, {}, [](const MeshDelta& delta) { return delta.points.cols(); });
  EXPECT_GT(10 * largest->points.cols(), 7 * static_cast<Eigen::Index>(a.vertices));
  EXPECT_TRUE(std::all_of(ahead.deltas.begin(), largest,
                          [](const MeshDelta& delta) { return delta.added.empty(); }));
}

TEST_P(SpeculativeSample, IsTheSameForAnyNumberOfThreads) {
  const auto manifold = Make(GetParam().manifold);
  Specification spec = AheadOn(*manifold, GetParam().epsilon);
  const DrivenRun one = Drive(spec, *manifold, {.threads = 1});
  EXPECT_TRUE(SameMesh(*one.mesher, *Drive(spec, *manifold, {.threads = 3}).mesher));
}

INSTANTIATE_TEST_SUITE_P(Catalogue, SpeculativeSample,
                         ::testing::Values(Case{"torus", 0.04, 8}, Case{"sphere:2", 0.04, 8},
                                           Case{"circle:3", 0.003, 8}, Case{"two-spheres", 0.06, 9},
                                           Case{"tanglecube", 0.05, 10}, Case{"sphere:3", 0.16, 9},
                                           Case{"so3", 0.33, 9}, Case{"flat-torus:3", 0.3, 10}));

// At 0.4 of its reach a mesh of T^3 twice as coarse does not come about.
TEST(SpeculativeSampler, LeavesToRingsWhatCannotBeGuessed) {
  const auto torus = Make("flat-torus:3");
  Specification spec = AheadOn(*torus, 0.4);
  const DrivenRun ahead = Drive(spec, *torus);
  ExpectGoodMesh(ahead, torus->facts());
  EXPECT_TRUE(SameMesh(*ahead.mesher, *Drive(spec, *torus, {.threads = 3}).mesher));
  spec.criteria.speculative = false;
  const DrivenRun plain = Drive(spec, *torus);
  EXPECT_LT(static_cast<double>(ahead.report().counts.vertices),
            1.05 * static_cast<double>(plain.report().counts.vertices));
  EXPECT_LT(static_cast<double>(ahead.report().counts.queries),
            1.3 * static_cast<double>(plain.report().counts.queries));
}

// M at closest points of what a sequence that fills the box gives, as a user would name them who
// has no box.
Specification Seeded(Manifold& manifold, double epsilon, Eigen::Index count) {
  Specification spec = SpecificationFor(manifold, epsilon);
  const int d = spec.ambient_dimension;
  Eigen::MatrixXd drawn(d, count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (int r = 0; r < d; ++r) {
      const double share = std::fmod((c + 1) * std::sqrt(2.0 + 3 * r), 1.0);
      drawn(r, c) = std::lerp(spec.bounding_box->lower[r], spec.bounding_box->upper[r], share);
    }
  spec.seeds = manifold.ClosestPoint(drawn).points;
  spec.bounding_box.reset();
  return spec;
}

class FewSeeds : public ::testing::TestWithParam<std::tuple<Case, int>> {};

TEST_P(FewSeeds, TakeNoMoreRoundsThanRingsAndHardlyMoreVertices) {
  const auto& [c, count] = GetParam();
  const auto manifold = Make(c.manifold);
  Specification spec = Seeded(*manifold, c.epsilon, count);
  const DrivenRun plain = Drive(spec, *manifold);
  spec.criteria.speculative = true;
  const DrivenRun ahead = Drive(spec, *manifold);
  ExpectGoodMesh(plain, manifold->facts());
  ExpectGoodMesh(ahead, manifold->facts());
  const Counts& a = ahead.report().counts;
  const Counts& p = plain.report().counts;
  EXPECT_LE(p.rounds, c.most_rounds);
  EXPECT_LE(a.rounds, p.rounds);
  EXPECT_LT(static_cast<double>(a.vertices), 1.07 * static_cast<double>(p.vertices));
}

TEST_P(FewSeeds, GiveTheSameForAnyNumberOfThreads) {
  const auto& [c, count] = GetParam();
  const auto manifold = Make(c.manifold);
  Specification spec = Seeded(*manifold, c.epsilon, count);
  spec.criteria.speculative = true;
  const DrivenRun one = Drive(spec, *manifold, {.threads = 1});
  EXPECT_TRUE(SameMesh(*one.mesher, *Drive(spec, *manifold, {.threads = 3}).mesher));
}

INSTANTIATE_TEST_SUITE_P(Sampler, FewSeeds,
                         ::testing::Combine(::testing::Values(Case{"sphere:2", 0.03, 26},
                                                              Case{"torus", 0.04, 26},
                                                              Case{"tanglecube", 0.05, 36},
                                                              Case{"flat-torus:3", 0.3, 40}),
                                            ::testing::Values(1, 4, 16)));

// A manifold of which an oracle says less still has such a mesh.
TEST(SpeculativeSampler, DoesWithClosestPointsAlone) {
  const auto torus = Make("torus");
  Specification spec = AheadOn(*torus, 0.05);
  spec.oracle = {};
  const DrivenRun run = Drive(spec, *torus);
  ExpectGoodMesh(run, torus->facts());
  EXPECT_LT(run.report().counts.rounds, 30u);
}

TEST(SpeculativeSampler, LeavesWhatWasNotFoundToTheRefinement) {
  const auto torus = Make("torus");
  Specification spec = AheadOn(*torus, 0.05);
  spec.oracle.intersect_flat = false;
  std::uint64_t round = 0;
  const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
    Answers answers = testing::AnswersOf(*torus, batch);
    if (++round > 8) return answers;
    for (AnswerBlock& block : answers.blocks) {
      block.found.assign(static_cast<std::size_t>(block.points.cols()), 1);
      for (Eigen::Index i = 0; i < block.points.cols(); ++i)
        block.found[static_cast<std::size_t>(i)] = testing::PointHash(block.points.col(i)) > 0.2;
    }
    return answers;
  });
  ExpectGoodMesh(run, torus->facts());
}

TEST(SpeculativeSampler, KeepsABudgetOfVertices) {
  const auto torus = Make("torus");
  for (const std::uint64_t most : {5u, 60u, 1000u, 3000u}) {
    Specification spec = AheadOn(*torus, 0.04);
    spec.limits.max_vertices = most;
    std::uint64_t queries = 0;
    const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
      queries = std::max(queries, static_cast<std::uint64_t>(batch.size()));
      return testing::AnswersOf(*torus, batch);
    });
    EXPECT_EQ(run.report().termination, Termination::kVertexBudget) << most;
    EXPECT_EQ(run.report().counts.vertices, most);
    EXPECT_LT(queries, 2 * most + 2000);
  }
}

// As much of a coarse sample as would be of use: no more than that is asked for beside the sample.
TEST(SpeculativeSampler, AsksForLittleMoreThanABudgetOfVerticesFromFewSeeds) {
  const auto torus = Make("torus");
  for (const std::uint64_t most : {5u, 200u, 3000u}) {
    Specification spec = Seeded(*torus, 1e-4, 1);
    spec.criteria.speculative = true;
    spec.limits.max_vertices = most;
    const DrivenRun run = Drive(spec, *torus);
    EXPECT_EQ(run.report().termination, Termination::kVertexBudget) << most;
    EXPECT_EQ(run.report().counts.vertices, most);
    EXPECT_LT(run.report().counts.queries, 5 * most / 2 + 1000);
  }
}

TEST(SpeculativeSampler, LeavesToRingsWhatIsTooMuchToAskAtOnce) {
  const auto sphere = Make("sphere:2");
  for (const double epsilon : {1e-3, 1e-6, 1e-12}) {
    Specification spec = AheadOn(*sphere, epsilon);
    spec.limits.max_rounds = 5;
    std::uint64_t queries = 0;
    const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
      queries = std::max(queries, static_cast<std::uint64_t>(batch.size()));
      return testing::AnswersOf(*sphere, batch);
    });
    EXPECT_EQ(run.report().counts.rounds, 5u);
    EXPECT_LT(queries, 100'000u);
  }
}

TEST(SpeculativeSampler, HasPointsWhereverItIsCutShort) {
  const auto torus = Make("torus");
  Specification spec = AheadOn(*torus, 0.04);
  for (std::uint64_t rounds = 1; rounds < 6; ++rounds) {
    spec.limits.max_rounds = rounds;
    const DrivenRun run = Drive(spec, *torus);
    EXPECT_EQ(run.report().termination, Termination::kRoundBudget);
    EXPECT_EQ(run.report().counts.rounds, rounds);
    EXPECT_GT(run.mesher->Points().cols(), 3);
    EXPECT_FALSE(run.mesher->Simplices().empty());
    Eigen::Index handed_out = 0;
    for (const MeshDelta& delta : run.deltas) handed_out += delta.points.cols();
    EXPECT_EQ(handed_out, run.mesher->Points().cols());
  }
}

}  // namespace
}  // namespace stellate::core
