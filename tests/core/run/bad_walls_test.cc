// Oracles whose walls are wrong, each refused by name; and walls that are allowed although they
// look odd.

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "tests/core/support/domains.h"
#include "tests/core/support/wall_mesh.h"

namespace stellate::core {
namespace {

using stellate::testing::Domain;

// What an oracle that answers through `spoil` comes to.
Report ReportOf(Domain m, double epsilon,
                const std::function<void(const QueryBlock&, AnswerBlock*)>& spoil) {
  auto mesher = Mesher::Create(m.SpecificationFor(epsilon));
  if (!mesher) throw std::runtime_error(mesher.error().message);
  while (const auto batch = (*mesher)->NextBatch()) {
    Answers answers = m.AnswersOf(*batch);
    for (std::size_t b = 0; b < answers.blocks.size(); ++b)
      spoil(batch->blocks[b], &answers.blocks[b]);
    if (auto delta = (*mesher)->Absorb(answers); !delta) (*mesher)->Fail(delta.error());
  }
  return (*mesher)->report();
}

// Turns conormals within M's tangent space by an angle, about the first coordinate axis that they
// do not lie along.
void TurnConormals(const Domain& m, double angle, const QueryBlock& asked, AnswerBlock* answer) {
  for (Eigen::Index j = 0; asked.face != 0 && j < asked.size(); ++j) {
    if (!answer->found[static_cast<std::size_t>(j)]) continue;
    const Eigen::MatrixXd tangents = m.Tangents(answer->points.col(j));
    for (int w = 0; w < CountWalls(asked.face); ++w) {
      auto conormal = answer->conormals.col(j).segment(w * m.d, m.d);
      Eigen::VectorXd across = Eigen::VectorXd::Zero(m.d);
      for (int i = 0; i < m.d && across.norm() < 0.5; ++i) {
        across = tangents * tangents.row(i).transpose();
        across -= conormal * conormal.dot(across);
      }
      conormal = (std::cos(angle) * conormal + std::sin(angle) * across.normalized()).eval();
    }
  }
}

void ExpectFailure(const Report& report, StatusCode code, const std::string& words) {
  EXPECT_EQ(report.termination, Termination::kOracleFailed) << report.certificate.verdict;
  EXPECT_EQ(StatusCodeName(report.failure.code), std::string(StatusCodeName(code)));
  EXPECT_NE(report.failure.message.find(words), std::string::npos) << report.failure.message;
}

class TurnedConormals : public ::testing::TestWithParam<Domain (*)()> {};

TEST_P(TurnedConormals, AreRefusedWhereTheyDoHarm) {
  const Domain m = GetParam()();
  const auto turned = [&](double angle) {
    return ReportOf(m, 0.3, [&](const QueryBlock& asked, AnswerBlock* answer) {
      TurnConormals(m, angle, asked, answer);
    });
  };
  ExpectFailure(turned(0.3), StatusCode::kOracleBadConormal, "turned by more than 0.2 radians");
  EXPECT_TRUE(turned(0.1).certificate.certified) << "a little turned they do none";
}

TEST_P(TurnedConormals, AreRefusedWhereTheyPointInward) {
  const Report report =
      ReportOf(GetParam()(), 0.3, [](const QueryBlock& asked, AnswerBlock* answer) {
        if (asked.face != 0) answer->conormals = -answer->conormals;
      });
  ExpectFailure(report, StatusCode::kOracleBadConormal, "points inward");
}

INSTANTIATE_TEST_SUITE_P(Domains, TurnedConormals,
                         ::testing::Values(stellate::testing::Hemisphere, stellate::testing::Disc,
                                           stellate::testing::Ball));

TEST(BadWallsTest, ABoundaryOffTheManifoldIsRefused) {
  const Report report = ReportOf(stellate::testing::Hemisphere(), 0.3,
                                 [](const QueryBlock& asked, AnswerBlock* answer) {
                                   if (asked.face != 0)
                                     answer->points *= 1.05;  // of a larger sphere
                                 });
  ExpectFailure(report, StatusCode::kOracleNotIdempotent, "wall 0 at its point");
  EXPECT_NE(report.failure.message.find("is not on the manifold"), std::string::npos);
}

TEST(BadWallsTest, ABoundaryInsideOfTheManifoldIsRefused) {
  const Report report =
      ReportOf(stellate::testing::Disc(), 0.3, [](const QueryBlock& asked, AnswerBlock* answer) {
        if (asked.face != 0) answer->points *= 0.9;
      });
  ExpectFailure(report, StatusCode::kOracleNotIdempotent, "does not end the manifold");
}

TEST(BadWallsTest, WallsThatLeaveNothingAreRefused) {
  Domain m = stellate::testing::Hemisphere();
  m.walls = {stellate::testing::HalfSpaceOf(Eigen::Vector3d::UnitZ(), -5)};
  ExpectFailure(ReportOf(m, 0.3, [](const QueryBlock&, AnswerBlock*) {}), StatusCode::kNoSeeds,
                "a single point, or too small for any seed");
}

// Their conormals are right.
TEST(BadWallsTest, PiecesFarSmallerThanEpsilonAreNotCalledAWrongConormalAlone) {
  for (const bool is_void : {false, true}) {
    Domain m = stellate::testing::Ball();
    const auto tiny = stellate::testing::BallOf(Eigen::Vector3d::Zero(), 1e-3, is_void ? 1 : -1, 3);
    if (is_void)
      m.walls.push_back(tiny);
    else
      m.walls = {tiny};
    const Report report = ReportOf(m, 0.3, [](const QueryBlock&, AnswerBlock*) {});
    EXPECT_EQ(report.termination, Termination::kOracleFailed) << report.certificate.verdict;
    EXPECT_NE(report.failure.message.find("a void or a piece far smaller than epsilon"),
              std::string::npos)
        << report.failure.message;
  }
}

// Walls may be the sides of the box: the refusal says that the manifold lies beside it. The tilted
// plane has points on walls, all beyond others; the sphere has none.
TEST(BadWallsTest, ABoxBesideTheManifoldIsRefusedInWordsOfBoxes) {
  const Eigen::Vector3d lower(-1, -1, 2), upper(1, 1, 3);
  for (const auto& equation : {stellate::testing::HalfSpaceOf(Eigen::Vector3d(0.2, 0.1, 1), 0),
                               stellate::testing::BallOf(Eigen::Vector3d(0, 0, -1), 1, 1, 3)}) {
    Domain m = stellate::testing::Make(2, 3, 1, {}, {});
    m.equations = {equation};
    for (int i = 0; i < 3; ++i) {
      m.walls.push_back(stellate::testing::HalfSpaceOf(Eigen::Vector3d::Unit(i), -lower[i]));
      m.walls.push_back(stellate::testing::HalfSpaceOf(-Eigen::Vector3d::Unit(i), upper[i]));
    }
    Specification spec = m.SpecificationFor(0.3);
    spec.bounding_box = BoundingBox{lower, upper};
    spec.seeds = {};
    const Report report = stellate::testing::MeshOf(m, spec).report;
    ExpectFailure(report, StatusCode::kNoSeeds,
                  "nothing of the manifold was found in the bounding box");
    EXPECT_NE(report.failure.message.find(" away at ("), std::string::npos)
        << report.failure.message;
  }
}

TEST(BadWallsTest, TangentialWallsAreRefused) {
  Domain m = stellate::testing::Hemisphere();
  m.walls.push_back(stellate::testing::HalfSpaceOf(Eigen::Vector3d(0.25, 0.3, 1), 0.1));
  auto mesher = Mesher::Create(m.SpecificationFor(0.3));
  ASSERT_TRUE(mesher);
  Status refused = Status::Ok();
  while (const auto batch = refused.ok() ? (*mesher)->NextBatch() : nullptr)
    if (auto delta = (*mesher)->Absorb(m.AnswersOf(*batch)); !delta) refused = delta.error();
  EXPECT_EQ(refused.code, StatusCode::kOracleBadConormal);
  EXPECT_NE(refused.message.find("nearly tangentially: walls 0 and 1 at 17"), std::string::npos)
      << refused.message;
  EXPECT_NE(refused.message.find(" degrees, at ("), std::string::npos) << refused.message;
}

TEST(BadWallsTest, AWallOfWhichNoPointIsFoundIsNamed) {
  const Report report = ReportOf(stellate::testing::Hemisphere(), 0.3,
                                 [](const QueryBlock& asked, AnswerBlock* answer) {
                                   if (asked.face != 0)
                                     answer->found.assign(answer->found.size(), 0);
                                 });
  EXPECT_FALSE(report.certificate.certified);
  EXPECT_NE(report.certificate.verdict.find("no point of wall 0 was found"), std::string::npos)
      << report.certificate.verdict;
}

TEST(BadWallsTest, AWallThatCutsNothingIsAllowedAndSaid) {
  Domain m = stellate::testing::Hemisphere();
  m.walls = {stellate::testing::HalfSpaceOf(Eigen::Vector3d::UnitZ(), 5)};
  const Certificate c = ReportOf(m, 0.3, [](const QueryBlock&, AnswerBlock*) {}).certificate;
  EXPECT_TRUE(c.certified) << c.verdict;
  EXPECT_NE(c.verdict.find("no wall cuts it"), std::string::npos) << c.verdict;
}

TEST(BadWallsTest, SixtyFiveWallsAreTooMany) {
  Domain m = stellate::testing::Hemisphere();
  m.walls.assign(65, m.walls[0]);
  const auto mesher = Mesher::Create(m.SpecificationFor(0.3));
  ASSERT_FALSE(mesher);
  EXPECT_EQ(mesher.error().code, StatusCode::kInvalidArgument);
  EXPECT_EQ(mesher.error().field, "walls");
  EXPECT_NE(mesher.error().message.find("walls is 65"), std::string::npos);
}

}  // namespace
}  // namespace stellate::core
