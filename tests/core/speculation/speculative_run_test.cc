// Speculative runs: a handful of round trips, the same guarantee, size and shape.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "core/speculation/surrogate.h"
#include "tests/core/support/in_process_run.h"
#include "tests/core/support/point_hash.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::ExpectGoodMesh;
using testing::Make;
using testing::SpecificationFor;

struct AheadCase {
  std::string manifold;
  double epsilon;
  bool tangents = true;
};

void PrintTo(const AheadCase& c, std::ostream* out) {
  *out << c.manifold << " epsilon " << c.epsilon << (c.tangents ? "" : " without tangents");
}

class SpeculativeRun : public ::testing::TestWithParam<AheadCase> {
 protected:
  Specification Spec(Manifold& manifold) const {
    Specification spec = SpecificationFor(manifold, GetParam().epsilon);
    spec.oracle.tangent_basis = GetParam().tangents;
    spec.criteria.speculative = true;
    return spec;
  }
};

TEST_P(SpeculativeRun, TakesFarFewerRoundsForAsGoodAMesh) {
  const auto manifold = Make(GetParam().manifold);
  Specification plain_spec = Spec(*manifold);
  plain_spec.criteria.speculative = false;
  const DrivenRun plain = Drive(plain_spec, *manifold);
  const DrivenRun ahead = Drive(Spec(*manifold), *manifold);
  ExpectGoodMesh(ahead, manifold->facts());
  EXPECT_LT(manifold->Distance(ahead.mesher->Points()).maxCoeff(), 1e-9);
  const Counts& a = ahead.report().counts;
  const Counts& p = plain.report().counts;
  EXPECT_LT(2 * a.rounds, p.rounds);
  // So coarse a mesh of SO(3) takes 1.08 times as many, from 1.05 to 1.12 by random seed.
  const double most = manifold->dimension() == 3 ? 1.15 : 1.07;
  EXPECT_LT(static_cast<double>(a.vertices), most * static_cast<double>(p.vertices));
  // The worst simplex of one run is chance: `tests/bench/run rounds` compares over seeds.
  EXPECT_GT(ahead.report().certificate.min_fatness, 0.6 * plain.report().certificate.min_fatness);
  if (manifold->dimension() == 2) {
    EXPECT_GT(ahead.report().certificate.min_angle_degrees,
              plain.report().certificate.min_angle_degrees - 5);
  }
}

TEST_P(SpeculativeRun, IsDeterministicForAnyNumberOfThreads) {
  const auto manifold = Make(GetParam().manifold);
  Specification spec = Spec(*manifold);
  const DrivenRun one = Drive(spec, *manifold, {.threads = 1});
  const DrivenRun three = Drive(spec, *manifold, {.threads = 3});
  EXPECT_EQ(one.mesher->Points(), three.mesher->Points());
  EXPECT_EQ(one.mesher->Simplices(), three.mesher->Simplices());
}

INSTANTIATE_TEST_SUITE_P(Catalogue, SpeculativeRun,
                         ::testing::Values(AheadCase{"torus", 0.08}, AheadCase{"sphere:2:10", 0.08},
                                           AheadCase{"torus", 0.1, false}, AheadCase{"rp2", 0.12},
                                           AheadCase{"two-spheres", 0.15}, AheadCase{"so3", 0.5}));

// What an oracle gets wrong costs rounds, never the guarantee.

Specification AheadOnTorus(Manifold& torus, double epsilon) {
  Specification spec = SpecificationFor(torus, epsilon);
  spec.criteria.speculative = true;
  spec.oracle.intersect_flat = false;  // what is tampered with below must not leave its flat
  return spec;
}

TEST(SpeculativeRunFaults, AnswersThatAreMissingHereAndThereAreDoneWithout) {
  const auto torus = Make("torus");
  const auto mesher = testing::NewMesher(AheadOnTorus(*torus, 0.1));
  while (const auto batch = mesher->NextBatch()) {
    Answers answers = testing::AnswersOf(*torus, *batch);
    for (std::size_t b = 0; b < batch->blocks.size(); ++b) {
      if (mesher->progress().phase == Phase::kCertifying) continue;
      std::vector<std::uint8_t>& found = answers.blocks[b].found;
      found.assign(static_cast<std::size_t>(batch->blocks[b].size()), 1);
      for (Eigen::Index i = 0; i < batch->blocks[b].size(); ++i)
        found[static_cast<std::size_t>(i)] =
            testing::PointHash(batch->blocks[b].points.col(i)) > 0.2;
    }
    ASSERT_TRUE(mesher->Absorb(answers));
  }
  EXPECT_EQ(mesher->report().termination, Termination::kConverged);
  EXPECT_TRUE(mesher->report().certificate.certified) << mesher->report().certificate.verdict;
}

TEST(SpeculativeRunFaults, APlaceThatIsNeverFoundEndsTheRun) {
  const auto torus = Make("torus");
  Specification spec = AheadOnTorus(*torus, 0.3);
  spec.limits.max_rounds = 5000;
  const DrivenRun run = Drive(spec, [&](const QueryBatch& batch) {
    Answers answers = testing::AnswersOf(*torus, batch);
    for (AnswerBlock& block : answers.blocks) {
      block.found.assign(static_cast<std::size_t>(block.points.cols()), 1);
      for (Eigen::Index i = 0; i < block.points.cols(); ++i)
        block.found[static_cast<std::size_t>(i)] = block.points(0, i) < 1.1;
    }
    return answers;
  });
  EXPECT_EQ(run.report().termination, Termination::kNoProgress);
  EXPECT_FALSE(run.report().certificate.certified);
}

TEST(SpeculativeRunFaults, NoiseAtItsToleranceIsMeshed) {
  const auto torus = Make("torus");
  const double epsilon = 0.1;
  const DrivenRun run = Drive(AheadOnTorus(*torus, epsilon), [&](const QueryBatch& batch) {
    Answers answers = testing::AnswersOf(*torus, batch);
    for (AnswerBlock& block : answers.blocks)
      for (Eigen::Index i = 0; i < block.points.cols(); ++i) {
        const Eigen::VectorXd y = block.points.col(i);
        const Eigen::Vector3d normal = Eigen::Vector3d(y).normalized();
        block.points.col(i) += 3e-4 * epsilon * (testing::PointHash(y) - 0.5) * normal;
      }
    return answers;
  });
  EXPECT_EQ(run.report().termination, Termination::kConverged);
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
}

TEST(SpeculativeRunFaults, ABudgetOfVerticesIsKept) {
  const auto torus = Make("torus");
  Specification spec = AheadOnTorus(*torus, 0.05);
  spec.limits.max_vertices = 1000;
  const DrivenRun run = Drive(spec, *torus);
  EXPECT_EQ(run.report().termination, Termination::kVertexBudget);
  EXPECT_EQ(run.report().counts.vertices, 1000u);
}

// On a sample of spacing h the graphs are right to fourth order in h.
TEST(Surrogate, ConvergesToFourthOrder) {
  const auto torus = Make("torus");
  double errors[2];
  for (const int level : {0, 1}) {
    const double h = level == 0 ? 0.12 : 0.06;
    const DrivenRun run = Drive(SpecificationFor(*torus, h), *torus);
    Stars<2> stars(3, h, {10 * h, CentreRule::kTangentSpace});
    const Eigen::MatrixXd points = run.mesher->Points();
    const Eigen::MatrixXd tangents = torus->TangentBasis(points);
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      double rows[6];
      for (int j = 0; j < 3; ++j)
        for (int a = 0; a < 2; ++a) rows[a * 3 + j] = tangents(j * 2 + a, i);
      stars.Add(points.col(i).data(), rows);
    }
    stars.Commit();
    Surrogate<2> surrogate(stars, h, h);
    const Eigen::MatrixXd middles =
        0.5 * (points.leftCols(points.cols() - 1) + points.rightCols(points.cols() - 1));
    const Eigen::MatrixXd near = torus->ClosestPoint(middles).points;
    // Only midpoints of neighbours are near the torus.
    std::vector<Eigen::Index> local;
    for (Eigen::Index i = 0; i < near.cols(); ++i)
      if ((points.col(i) - points.col(i + 1)).norm() < 2.5 * h) local.push_back(i);
    ASSERT_GT(local.size(), 5u);
    const AnsweredPoints answer =
        surrogate.Answer(near(Eigen::all, local), std::vector<const double*>(local.size()),
                         Eigen::VectorXd::Zero(static_cast<Eigen::Index>(local.size())));
    errors[level] = 0;
    std::size_t answered = 0;
    for (Eigen::Index i = 0; i < answer.points.cols(); ++i) {
      if (!answer.found[static_cast<std::size_t>(i)]) continue;
      ++answered;
      errors[level] = std::max(errors[level], torus->Distance(answer.points.col(i)).maxCoeff());
    }
    EXPECT_GT(answered, local.size() / 2);
  }
  EXPECT_LT(errors[1], errors[0] / 8);  // 16 in theory; the largest error is a noisy measure
}

}  // namespace
}  // namespace stellate::core
