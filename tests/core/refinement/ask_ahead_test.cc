// Asking ahead: fewer round trips, the same guarantee, about the same size.

#include <gtest/gtest.h>

#include <string>

#include "core/refinement/surrogate.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::ExpectGoodMesh;
using testing::Make;
using testing::SpecificationFor;

struct Case {
  std::string manifold;
  double epsilon;
  bool tangents = true;
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.manifold << " epsilon " << c.epsilon << (c.tangents ? "" : " without tangents");
}

class AskAhead : public ::testing::TestWithParam<Case> {
 protected:
  Specification Spec(Manifold& manifold) const {
    Specification spec = SpecificationFor(manifold, GetParam().epsilon);
    spec.oracle.tangent_basis = GetParam().tangents;
    spec.criteria.ask_ahead = true;
    return spec;
  }
};

TEST_P(AskAhead, TakesFewerRoundsForAsGoodAMesh) {
  const auto manifold = Make(GetParam().manifold);
  Specification plain_spec = Spec(*manifold);
  plain_spec.criteria.ask_ahead = false;
  const DrivenRun plain = Drive(plain_spec, *manifold);
  const DrivenRun ahead = Drive(Spec(*manifold), *manifold);
  ExpectGoodMesh(ahead, manifold->facts());
  EXPECT_LT(manifold->Distance(ahead.mesher->Points()).maxCoeff(), 1e-9);
  EXPECT_LT(ahead.report().counts.rounds, plain.report().counts.rounds);
  EXPECT_LT(static_cast<double>(ahead.report().counts.vertices),
            1.15 * static_cast<double>(plain.report().counts.vertices));
}

TEST_P(AskAhead, IsDeterministicForAnyNumberOfThreads) {
  const auto manifold = Make(GetParam().manifold);
  Specification spec = Spec(*manifold);
  spec.threads = 1;
  const DrivenRun one = Drive(spec, *manifold);
  spec.threads = 3;
  const DrivenRun three = Drive(spec, *manifold);
  EXPECT_EQ(one.mesher->Points(), three.mesher->Points());
  EXPECT_EQ(one.mesher->Simplices(), three.mesher->Simplices());
}

INSTANTIATE_TEST_SUITE_P(Catalogue, AskAhead,
                         ::testing::Values(Case{"torus", 0.08}, Case{"sphere:2:10", 0.08},
                                           Case{"torus", 0.1, false}, Case{"rp2", 0.12}));

// On a sample of spacing h the quadrics are right to third order in h.
TEST(Surrogate, ConvergesToThirdOrder) {
  const auto torus = Make("torus");
  double errors[2];
  for (const int level : {0, 1}) {
    const double h = level == 0 ? 0.12 : 0.06;
    const DrivenRun run = Drive(SpecificationFor(*torus, h), *torus);
    StarComplex<2> complex(3, h, 10 * h, Judging::kFlats);
    const Eigen::MatrixXd points = run.mesher->Points();
    const Eigen::MatrixXd tangents = torus->TangentBasis(points);
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      double rows[6];
      for (int j = 0; j < 3; ++j)
        for (int a = 0; a < 2; ++a) rows[a * 3 + j] = tangents(j * 2 + a, i);
      complex.Append(points.col(i).data(), rows);
    }
    complex.Commit();
    const Surrogate<2> surrogate(complex);
    QueryBlock block;
    block.points = 0.5 * (points.leftCols(points.cols() - 1) + points.rightCols(points.cols() - 1));
    const Eigen::MatrixXd near = torus->ClosestPoint(block.points).points;
    // Only midpoints of neighbours are near the torus.
    std::vector<Eigen::Index> local;
    for (Eigen::Index i = 0; i < near.cols(); ++i)
      if ((points.col(i) - points.col(i + 1)).norm() < 2.5 * h) local.push_back(i);
    ASSERT_GT(local.size(), 5u);
    block.points = near(Eigen::all, local);
    const AnswerBlock answer = surrogate.Answer(block);
    errors[level] = 0;
    std::size_t answered = 0;
    for (Eigen::Index i = 0; i < answer.points.cols(); ++i) {
      if (!answer.found[static_cast<std::size_t>(i)]) continue;
      ++answered;
      errors[level] =
          std::max(errors[level], torus->Distance(answer.points.col(i)).maxCoeff());
    }
    EXPECT_GT(answered, local.size() / 2);
  }
  EXPECT_LT(errors[1], errors[0] / 4);  // 8 in theory; the largest error is a noisy measure
}

}  // namespace
}  // namespace stellate::core
