// What a mesh costs an oracle of closest points alone: counts of questions, not timings.

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <functional>
#include <string>

#include "core/base/random.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::ExpectGoodMesh;
using testing::Make;
using testing::SpecificationFor;

struct Price {
  std::string manifold;
  double epsilon;
  double questions;  // at most so many a vertex, certificate included
  std::uint64_t rounds;
};
void PrintTo(const Price& p, std::ostream* out) { *out << p.manifold << " epsilon " << p.epsilon; }

Specification ClosestPointsAlone(Manifold& manifold, double epsilon) {
  Specification spec = SpecificationFor(manifold, epsilon);
  spec.oracle = {};
  return spec;
}

double QuestionsAVertex(const Counts& counts) {
  return static_cast<double>(counts.queries + counts.tangent_queries) /
         static_cast<double>(counts.vertices);
}

class FewQuestions : public ::testing::TestWithParam<Price> {};

TEST_P(FewQuestions, WithClosestPointsAlone) {
  const auto manifold = Make(GetParam().manifold);
  const DrivenRun run = Drive(ClosestPointsAlone(*manifold, GetParam().epsilon), *manifold);
  ExpectGoodMesh(run, manifold->facts());
  const Counts& counts = run.report().counts;
  EXPECT_LE(QuestionsAVertex(counts), GetParam().questions);
  EXPECT_LE(counts.rounds, GetParam().rounds);
}

INSTANTIATE_TEST_SUITE_P(Codimension1, FewQuestions,
                         ::testing::Values(Price{"torus", 0.0267, 1.6, 26},
                                           Price{"sphere:2", 0.0245, 1.6, 24},
                                           Price{"sphere:3", 0.11, 2.0, 28}));

INSTANTIATE_TEST_SUITE_P(HigherCodimension, FewQuestions,
                         ::testing::Values(Price{"clifford-torus", 0.029, 1.8, 30},
                                           Price{"so3", 0.28, 2.5, 34},
                                           Price{"flat-torus:3", 0.24, 2.2, 42}));

// Answers that are a little wrong.
TEST(FewQuestions, WithInexactAnswers) {
  const auto manifold = Make("torus");
  const Specification spec = ClosestPointsAlone(*manifold, 0.05);
  const auto answer = testing::AnswererFor(*manifold);
  const auto rounded = [&](const QueryBatch& batch) {
    Answers answers = answer(batch);
    for (AnswerBlock& block : answers.blocks)
      block.points = block.points.cast<float>().cast<double>().eval();
    return answers;
  };
  std::uint64_t batches = 0;
  const auto inexact = [&](const QueryBatch& batch) {
    Answers answers = answer(batch);
    for (AnswerBlock& block : answers.blocks) {
      Random random(++batches, 7);
      for (double& x : block.points.reshaped()) x += 1e-6 * (2 * random.Uniform() - 1);
    }
    return answers;
  };
  for (const testing::Answerer& each : {testing::Answerer(rounded), testing::Answerer(inexact)}) {
    const DrivenRun run = Drive(spec, each);
    ExpectGoodMesh(run, manifold->facts());
    EXPECT_LE(run.report().counts.tangent_queries, run.report().counts.vertices / 5);
    EXPECT_LT(manifold->Distance(run.mesher->Points()).maxCoeff(), 3e-6);
  }
}

// With a declared reach normals enter the proof, with no error of their own.
TEST(FewQuestions, ForAProof) {
  const auto manifold = Make("torus");
  Specification spec = ClosestPointsAlone(*manifold, 0.06);
  spec.declared_reach = 0.4;
  const DrivenRun run = Drive(spec, *manifold);
  ExpectGoodMesh(run, manifold->facts());
  EXPECT_EQ(run.report().certificate.level, CertificateLevel::kProved);
  EXPECT_LE(run.report().counts.tangent_queries, run.report().counts.vertices / 5);
}

// No estimate enters one: in higher codimension it takes differences.
TEST(FewQuestions, ButNoneLessForAProofInHigherCodimension) {
  const auto manifold = Make("clifford-torus");
  Specification spec = ClosestPointsAlone(*manifold, 0.15);
  spec.declared_reach = manifold->facts().reach;
  const DrivenRun run = Drive(spec, *manifold);
  ExpectGoodMesh(run, manifold->facts());
  EXPECT_EQ(run.report().certificate.level, CertificateLevel::kProved);
  EXPECT_GE(run.report().counts.tangent_queries, 4 * run.report().counts.vertices);
}

}  // namespace
}  // namespace stellate::core
