// Budgets, endings, and oracles that answer wrongly, not at all, or not quite right.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>

#include "core/base/infinity.h"
#include "core/base/random.h"
#include "tests/core/support/in_process_run.h"
#include "tests/core/support/nan.h"

namespace stellate::core {
namespace {

using testing::AnswererFor;
using testing::AnswersOf;
using testing::Drive;
using testing::DrivenRun;
using testing::ExpectGoodMesh;
using testing::Make;
using testing::NewMesher;
using testing::SameMesh;
using testing::SpecificationFor;
using testing::Step;

using testing::kNaN;

// Endings.

TEST(Budget, OfVerticesIsKept) {
  const auto manifold = Make("torus");
  Specification spec = SpecificationFor(*manifold, 0.1);
  for (const std::uint64_t most : {1, 10, 200}) {
    spec.limits.max_vertices = most;
    const DrivenRun run = Drive(spec, *manifold);
    EXPECT_EQ(run.report().termination, Termination::kVertexBudget);
    EXPECT_EQ(run.report().counts.vertices, most);
    EXPECT_EQ(static_cast<std::uint64_t>(run.mesher->Points().cols()), most);
    EXPECT_FALSE(run.report().certificate.certified);
    EXPECT_FALSE(run.report().certificate.verdict.empty());
  }
}

TEST(Budget, OfRoundsIsKept) {
  const auto manifold = Make("torus");
  Specification spec = SpecificationFor(*manifold, 0.1);
  for (const std::uint64_t most : {1, 2, 7}) {
    spec.limits.max_rounds = most;
    const DrivenRun run = Drive(spec, *manifold);
    EXPECT_EQ(run.report().termination, Termination::kRoundBudget);
    EXPECT_EQ(run.report().counts.rounds, most);
    EXPECT_EQ(run.deltas.size(), most);
    EXPECT_FALSE(run.report().certificate.certified);
  }
}

// The mesh of a smaller budget is where the larger one passed through.
TEST(Budget, OfRoundsStopsTheSameRunEarlier) {
  const auto manifold = Make("torus");
  Specification spec = SpecificationFor(*manifold, 0.2);
  const DrivenRun whole = Drive(spec, *manifold);
  spec.limits.max_rounds = 6;
  const DrivenRun part = Drive(spec, *manifold);
  const Eigen::MatrixXd points = part.mesher->Points();
  EXPECT_LT(points.cols(), whole.mesher->Points().cols());
  EXPECT_EQ(points, whole.mesher->Points().leftCols(points.cols()));
}

TEST(Budget, ThatIsJustEnoughConverges) {
  const auto manifold = Make("torus");
  Specification spec = SpecificationFor(*manifold, 0.3);
  const DrivenRun whole = Drive(spec, *manifold);
  spec.limits.max_rounds = whole.report().counts.rounds;
  spec.limits.max_vertices = whole.report().counts.vertices + 1;
  const DrivenRun same = Drive(spec, *manifold);
  EXPECT_TRUE(SameMesh(*whole.mesher, *same.mesher));
  EXPECT_TRUE(same.report().certificate.certified);
}

TEST(Ending, ByCancelKeepsTheMeshAsItStands) {
  const auto manifold = Make("torus");
  const Specification spec = SpecificationFor(*manifold, 0.2);
  for (const int rounds : {0, 1, 5}) {
    const auto mesher = NewMesher(spec);
    for (int r = 0; r < rounds; ++r) Step(*mesher, AnswererFor(*manifold));
    const Answers late = AnswersOf(*manifold, *mesher->NextBatch());
    const Eigen::MatrixXd points = mesher->Points();
    const auto simplices = mesher->Simplices();
    mesher->Cancel();
    EXPECT_EQ(mesher->NextBatch(), nullptr);
    EXPECT_EQ(mesher->report().termination, Termination::kCancelled);
    EXPECT_EQ(mesher->progress().phase, Phase::kDone);
    EXPECT_LT(mesher->progress().fraction, 1);
    EXPECT_FALSE(mesher->report().certificate.certified);
    const auto refused = mesher->Absorb(late);
    ASSERT_FALSE(refused.has_value());
    EXPECT_EQ(refused.error().code, StatusCode::kFailedPrecondition);
    mesher->Fail({StatusCode::kOracleFailed, "too late"});
    mesher->Cancel();
    EXPECT_EQ(mesher->report().termination, Termination::kCancelled);
    EXPECT_TRUE(mesher->report().failure.ok());
    EXPECT_EQ(mesher->Points(), points);
    EXPECT_EQ(mesher->Simplices(), simplices);
    EXPECT_EQ(mesher->report().counts.vertices, static_cast<std::uint64_t>(points.cols()));
  }
}

TEST(Ending, ByFailureCarriesItsReason) {
  const auto manifold = Make("torus");
  const auto mesher = NewMesher(SpecificationFor(*manifold, 0.2));
  for (int r = 0; r < 4; ++r) Step(*mesher, AnswererFor(*manifold));
  mesher->Fail({StatusCode::kOracleFailed, "the oracle raised ZeroDivisionError"});
  EXPECT_EQ(mesher->NextBatch(), nullptr);
  const Report& report = mesher->report();
  EXPECT_EQ(report.termination, Termination::kOracleFailed);
  EXPECT_EQ(report.failure.code, StatusCode::kOracleFailed);
  EXPECT_EQ(report.failure.message, "the oracle raised ZeroDivisionError");
  EXPECT_FALSE(report.certificate.certified);
  EXPECT_NE(report.certificate.verdict.find("ZeroDivisionError"), std::string::npos);
}

TEST(Ending, AfterConvergenceNothingChanges) {
  const auto manifold = Make("circle:3");
  const Specification spec = SpecificationFor(*manifold, 0.3);
  const DrivenRun run = Drive(spec, *manifold), same = Drive(spec, *manifold);
  run.mesher->Cancel();
  run.mesher->Fail({StatusCode::kOracleFailed, "too late"});
  EXPECT_EQ(run.mesher->NextBatch(), nullptr);
  EXPECT_TRUE(run.report().certificate.certified);
  EXPECT_TRUE(SameMesh(*run.mesher, *same.mesher));
}

// Answers that are wrong where it can be seen.

// Spoils right answers; false when this batch gives no occasion.
using Spoil = std::function<bool(const QueryBatch&, Answers&)>;

struct Fault {
  std::string name;
  StatusCode code;
  Spoil spoil;
};

void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

// The first block, or the first of a kind.
Spoil OnBlock(std::optional<QueryKind> kind,
              const std::function<void(const QueryBlock&, AnswerBlock&)>& spoil) {
  return [=](const QueryBatch& batch, Answers& answers) {
    for (std::size_t b = 0; b < batch.blocks.size(); ++b) {
      if (kind && batch.blocks[b].kind != *kind) continue;
      spoil(batch.blocks[b], answers.blocks[b]);
      return true;
    }
    return false;
  };
}

Spoil OnAny(const std::function<void(const QueryBlock&, AnswerBlock&)>& spoil) {
  return OnBlock(std::nullopt, spoil);
}

// At the first answer that was found.
Spoil OnTangents(const std::function<void(AnswerBlock&, Eigen::Index)>& spoil) {
  return [=](const QueryBatch& batch, Answers& answers) {
    AnswerBlock& block = answers.blocks[0];
    const auto at = std::find(block.found.begin(), block.found.end(), 1);
    if (!batch.blocks[0].want.tangents || (!block.found.empty() && at == block.found.end()))
      return false;
    spoil(block, at - block.found.begin());
    return true;
  };
}

Spoil OnFlat(const std::function<void(const QueryBlock&, AnswerBlock&, Eigen::Index)>& spoil) {
  return OnBlock(QueryKind::kIntersectFlat, [=](const QueryBlock& q, AnswerBlock& a) {
    a.found.assign(static_cast<std::size_t>(q.size()), 1);
    for (Eigen::Index j = 0; j < q.size(); ++j) spoil(q, a, j);
  });
}

const Fault kFaults[] = {
    {"NaN", StatusCode::kOracleNotFinite, OnAny([](const QueryBlock& q, AnswerBlock& a) {
       a.found.clear();
       a.points = q.points;
       a.points(0, q.size() - 1) = kNaN;
     })},
    {"infinity", StatusCode::kOracleNotFinite, OnAny([](const QueryBlock& q, AnswerBlock& a) {
       a.found.clear();
       a.points = q.points;
       a.points(1, q.size() - 1) = -kInfinity;
     })},
    {"NaN in a tangent", StatusCode::kOracleNotFinite,
     OnTangents([](AnswerBlock& a, Eigen::Index j) { a.tangents(1, j) = kNaN; })},
    {"an answer too few", StatusCode::kOracleShape, OnAny([](const QueryBlock& q, AnswerBlock& a) {
       a.points = q.points.leftCols(q.size() - 1);
     })},
    {"an answer too many", StatusCode::kOracleShape,
     OnAny([](const QueryBlock& q, AnswerBlock& a) { a.points = q.points.replicate(1, 2); })},
    {"a coordinate too few", StatusCode::kOracleShape,
     OnAny([](const QueryBlock& q, AnswerBlock& a) { a.points = q.points.topRows(2); })},
    {"flags of the wrong count", StatusCode::kOracleShape,
     OnAny([](const QueryBlock& q, AnswerBlock& a) {
       a.found.assign(static_cast<std::size_t>(q.size()) + 1, 1);
     })},
    {"no tangents", StatusCode::kOracleShape,
     OnTangents([](AnswerBlock& a, Eigen::Index) { a.tangents.resize(0, 0); })},
    {"tangents of the wrong size", StatusCode::kOracleShape,
     OnTangents([](AnswerBlock& a, Eigen::Index) { a.tangents = a.tangents.topRows(3).eval(); })},
    {"a block too many", StatusCode::kOracleShape,
     [](const QueryBatch&, Answers& a) {
       a.blocks.push_back(a.blocks.front());
       return true;
     }},
    {"no blocks", StatusCode::kOracleShape,
     [](const QueryBatch&, Answers& a) {
       a.blocks.clear();
       return true;
     }},
    {"tangents not of unit length", StatusCode::kOracleBadTangent,
     OnTangents([](AnswerBlock& a, Eigen::Index j) { a.tangents.col(j) *= 1.01; })},
    {"tangents not at right angles", StatusCode::kOracleBadTangent,
     OnTangents([](AnswerBlock& a, Eigen::Index j) {
       for (Eigen::Index r = 0; r < a.tangents.rows(); r += 2)
         a.tangents(r + 1, j) = a.tangents(r, j);
     })},
    {"off the flat", StatusCode::kOracleOffFlat,
     OnFlat([](const QueryBlock& q, AnswerBlock& a, Eigen::Index j) {
       a.points.col(j) = q.points.col(j);
       for (Eigen::Index i = 0; i < q.points.rows(); ++i)
         a.points(i, j) += 0.01 * q.radii[j] * q.bases(2 * i, j);
     })},
    {"outside the radius", StatusCode::kOracleOutsideRadius,
     OnFlat([](const QueryBlock& q, AnswerBlock& a, Eigen::Index j) {
       Eigen::Vector3d u, v;
       for (int i = 0; i < 3; ++i) {
         u[i] = q.bases(2 * i, j);
         v[i] = q.bases(2 * i + 1, j);
       }
       a.points.col(j) = q.points.col(j) + 1.01 * q.radii[j] * u.cross(v);
     })},
    {"not idempotent", StatusCode::kOracleNotIdempotent,
     [](const QueryBatch& batch, Answers& a) {
       if (batch.round != 2) return false;  // the one that asks for answered points again
       a.blocks.back().points.array() += 0.01;
       return true;
     }},
};

class Faults : public ::testing::TestWithParam<Fault> {};

// A torus in R^3, k = 2. Each batch is spoilt first, and then answered rightly.
TEST_P(Faults, AreRefusedAndForgotten) {
  const auto manifold = Make("torus");
  const Specification spec = SpecificationFor(*manifold, 0.3);
  const DrivenRun right = Drive(spec, *manifold);
  const auto mesher = NewMesher(spec);
  int refusals = 0;
  while (const auto batch = mesher->NextBatch()) {
    Answers answers = AnswersOf(*manifold, *batch);
    Answers spoilt = answers;
    if (GetParam().spoil(*batch, spoilt)) {
      const Progress before = mesher->progress();
      const Eigen::MatrixXd points = mesher->Points(), asked = batch->blocks[0].points;
      const auto delta = mesher->Absorb(spoilt);
      ASSERT_FALSE(delta.has_value()) << "round " << batch->round;
      EXPECT_STREQ(StatusCodeName(delta.error().code), StatusCodeName(GetParam().code))
          << delta.error().message;
      EXPECT_FALSE(delta.error().message.empty());
      ++refusals;
      ASSERT_EQ(mesher->NextBatch(), batch);
      EXPECT_EQ(batch->blocks[0].points, asked);
      EXPECT_EQ(mesher->Points(), points);
      EXPECT_EQ(mesher->progress().round, before.round);
      EXPECT_EQ(mesher->progress().queries, before.queries);
    }
    ASSERT_TRUE(mesher->Absorb(answers).has_value());
  }
  EXPECT_GT(refusals, 0);
  EXPECT_TRUE(SameMesh(*mesher, *right.mesher));
  EXPECT_TRUE(mesher->report().certificate.certified);
}

INSTANTIATE_TEST_SUITE_P(All, Faults, ::testing::ValuesIn(kFaults));

// What a client cannot find it leaves out, and its points are right to a solver's tolerance only.

std::uint64_t HashOf(const Eigen::MatrixXd& points, Eigen::Index column) {
  std::uint64_t h = 0;
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    h = Mix64(h ^ std::bit_cast<std::uint64_t>(points(i, column)));
  return h;
}

struct Imperfection {
  std::string manifold;
  double epsilon;
  OracleCapabilities oracle;
};

void PrintTo(const Imperfection& i, std::ostream* out) {
  *out << i.manifold << (i.oracle.intersect_flat ? " flats" : "")
       << (i.oracle.tangent_basis ? " tangents" : "");
}

class Imperfections : public ::testing::TestWithParam<Imperfection> {
 protected:
  Imperfections()
      : manifold_(Make(GetParam().manifold)),
        spec_(SpecificationFor(*manifold_, GetParam().epsilon)) {
    spec_.oracle = GetParam().oracle;
  }

  std::unique_ptr<Manifold> manifold_;
  Specification spec_;
};

// The same answers as ever, but one in ten "not found", always for the same questions.
Answers WithGaps(const QueryBatch& batch, Answers answers) {
  for (std::size_t b = 0; b < batch.blocks.size(); ++b) {
    std::vector<std::uint8_t>& found = answers.blocks[b].found;
    const Eigen::MatrixXd& asked = batch.blocks[b].points;
    if (found.empty()) found.assign(static_cast<std::size_t>(asked.cols()), 1);
    for (Eigen::Index j = 0; j < asked.cols(); ++j)
      if (HashOf(asked, j) % 10 == 0) found[static_cast<std::size_t>(j)] = 0;
  }
  return answers;
}

TEST_P(Imperfections, OneAnswerInTenMayBeMissingWhileTheMeshGrows) {
  DrivenRun run{NewMesher(spec_), {}};
  while (const auto batch = run.mesher->NextBatch()) {
    const bool gaps = run.mesher->progress().phase != Phase::kCertifying;
    const Answers answers = AnswersOf(*manifold_, *batch);
    auto delta = run.mesher->Absorb(gaps ? WithGaps(*batch, answers) : answers);
    ASSERT_TRUE(delta.has_value()) << delta.error().message;
    run.deltas.push_back(std::move(*delta));
  }
  ExpectGoodMesh(run, manifold_->facts());
}

// Nothing is certified on answers that were not given.
TEST_P(Imperfections, OneAnswerInTenMissingToTheCertifierIsNoCertificate) {
  DrivenRun run{NewMesher(spec_), {}};
  while (const auto batch = run.mesher->NextBatch()) {
    const bool gaps = run.mesher->progress().phase == Phase::kCertifying;
    const Answers answers = AnswersOf(*manifold_, *batch);
    auto delta = run.mesher->Absorb(gaps ? WithGaps(*batch, answers) : answers);
    ASSERT_TRUE(delta.has_value()) << delta.error().message;
  }
  EXPECT_EQ(run.report().termination, Termination::kConverged);
  EXPECT_FALSE(run.report().certificate.certified);
  EXPECT_NE(run.report().certificate.verdict.find("closest point"), std::string::npos)
      << run.report().certificate.verdict;
}

TEST_P(Imperfections, PointsMayBeWrongByATenThousandthOfEpsilon) {
  const DrivenRun run = Drive(spec_, [&](const QueryBatch& batch) {
    Answers answers = AnswersOf(*manifold_, batch);
    for (std::size_t b = 0; b < batch.blocks.size(); ++b) {
      const QueryBlock& asked = batch.blocks[b];
      for (Eigen::Index j = 0; j < asked.size(); ++j) {
        Random random(HashOf(asked.points, j));
        Eigen::VectorXd noise(asked.points.rows());
        for (double& x : noise) x = random.NearlyNormal();
        if (asked.kind == QueryKind::kIntersectFlat) {  // an answer off the flat would be refused
          using RowMajor = Eigen::Matrix<double, -1, -1, Eigen::RowMajor>;
          const Eigen::Map<const RowMajor> basis(asked.bases.col(j).data(), noise.size(),
                                                 spec_.dimension);
          noise -= basis * (basis.transpose() * noise);
        }
        answers.blocks[b].points.col(j) += 1e-4 * spec_.epsilon * noise.normalized();
      }
    }
    return answers;
  });
  ExpectGoodMesh(run, manifold_->facts());
}

INSTANTIATE_TEST_SUITE_P(Oracles, Imperfections,
                         ::testing::Values(Imperfection{"circle:10", 0.2, {true, true}},
                                           Imperfection{"torus", 0.2, {true, true}},
                                           Imperfection{"torus", 0.2, {false, true}},
                                           Imperfection{"torus", 0.2, {true, false}},
                                           Imperfection{"rp2", 0.4, {true, false}},
                                           Imperfection{"so3", 0.8, {true, true}}));

}  // namespace
}  // namespace stellate::core
