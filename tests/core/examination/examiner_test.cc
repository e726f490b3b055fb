// Each broken oracle is found out by the finding that names it, and good ones pass.
#include "core/examiner.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <random>
#include <set>
#include <stdexcept>
#include <utility>

#include "stellate/catalogue.h"
#include "tests/core/support/examined.h"
#include "tests/support/spoiled_oracle.h"

namespace stellate {
namespace {

using core::ChooseEpsilon;
using core::ChosenEpsilon;
using core::ExaminationReport;
using core::Finding;
using core::Severity;
using testing::Examine;
using testing::Find;
using testing::SpoiledOracle;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Broken {
  std::string code;
  std::function<void(SpoiledOracle&)> spoil;
};
void PrintTo(const Broken& broken, std::ostream* out) { *out << broken.code; }

class BrokenOracle : public ::testing::TestWithParam<Broken> {};

TEST_P(BrokenOracle, IsFoundOut) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  SpoiledOracle oracle(*torus);
  GetParam().spoil(oracle);
  const ExaminationReport report = Examine(oracle);
  const Finding* const finding = Find(report, GetParam().code);
  ASSERT_NE(finding, nullptr) << ToText(report);
  EXPECT_EQ(report.ok(), report.findings.front().severity != Severity::kError);
  EXPECT_EQ(finding->message.find('{'), std::string::npos) << finding->message;
  EXPECT_EQ(finding->advice.find('{'), std::string::npos) << finding->advice;
  EXPECT_FALSE(finding->advice.empty());
}

Broken Closest(const std::string& code,
               std::function<void(const Eigen::MatrixXd& x, Answer& a)> spoil) {
  return {code, [spoil](SpoiledOracle& oracle) { oracle.on_closest = spoil; }};
}
Broken Tangents(const std::string& code, std::function<void(Eigen::MatrixXd& bases)> spoil) {
  return {code, [spoil](SpoiledOracle& oracle) { oracle.on_tangents = spoil; }};
}
Broken Flats(const std::string& code,
             std::function<void(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                                const Eigen::VectorXd& radii, Answer& a)>
                 spoil) {
  return {code, [spoil](SpoiledOracle& oracle) { oracle.on_flat = spoil; }};
}

Broken Sizes(const std::string& code, std::function<void(Eigen::VectorXd& sizes)> spoil) {
  return {code, [spoil](SpoiledOracle& oracle) {
            oracle.on_sizes = [spoil](const auto&, Eigen::VectorXd& sizes) { spoil(sizes); };
          }};
}

// The surface of [-1, 1]^3.
void Cube(const Eigen::MatrixXd& x, Answer& a) {
  a.points = x.cwiseMax(-1).cwiseMin(1);
  a.found.clear();
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    Eigen::Index axis = 0;
    if (x.col(j).cwiseAbs().maxCoeff(&axis) < 1) a.points(axis, j) = x(axis, j) < 0 ? -1 : 1;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Each, BrokenOracle,
    ::testing::Values(
        Broken{"BAD_DIMENSIONS", [](SpoiledOracle& o) { o.k = 3; }},
        Broken{"NO_WHEREABOUTS", [](SpoiledOracle& o) { o.box.reset(); }},
        Broken{"OUTSIDE_BOX",
               [](SpoiledOracle& o) {
                 o.box = BoundingBox{-Eigen::Vector3d::Ones(), Eigen::Vector3d::Ones()};
               }},
        Broken{"WRONG_DIMENSION",
               [](SpoiledOracle& o) {
                 o.k = 1;
                 o.has_tangents = o.intersects = false;
               }},
        Broken{
            "ROUGH",
            [](SpoiledOracle& o) {
              o.on_closest = Cube;
              o.has_tangents = o.intersects = false;
              o.box = BoundingBox{-Eigen::Vector3d::Constant(1.1), Eigen::Vector3d::Constant(1.1)};
            }},
        Closest("RAISED", [](const auto&, Answer&) { throw std::runtime_error("on purpose"); }),
        Closest("WRONG_SHAPE",
                [](const auto&, Answer& a) { a.points = Eigen::MatrixXd(a.points.topRows(2)); }),
        Closest("NOT_FINITE", [](const auto&, Answer& a) { a.points(0, 0) = kNaN; }),
        Closest("NOTHING_FOUND", [](const auto&, Answer& a) { a.found.assign(a.found.size(), 0); }),
        Closest("MOSTLY_NOT_FOUND",
                [](const Eigen::MatrixXd& x, Answer& a) {
                  for (Eigen::Index j = 0; j < x.cols(); ++j) {
                    const bool near = (x.col(j) - a.points.col(j)).norm() < 0.1;
                    a.found[static_cast<size_t>(j)] = near;
                  }
                }),
        Closest("NOT_DETERMINISTIC",
                [calls = 0](const auto&, Answer& a) mutable {
                  a.points.array() += 1e-3 * ++calls;
                }),
        Closest("BATCH_DEPENDENT",
                [](const auto&, Answer& a) {
                  a.points.array() += 1e-3 / static_cast<double>(a.points.cols());
                }),
        Closest("NOT_IDEMPOTENT",
                [](const Eigen::MatrixXd& x, Answer& a) { a.points = (a.points + x) / 2; }),
        Closest("NOISY", [](const Eigen::MatrixXd& x,
                            Answer& a) { a.points.array() += 1e-8 * (1e6 * x.array()).sin(); }),
        Closest("NOT_CLOSEST",
                [](const Eigen::MatrixXd& x, Answer& a) {
                  // Across the tube from the right point, unless that is very near.
                  for (Eigen::Index j = 0; j < x.cols(); ++j) {
                    if ((x.col(j) - a.points.col(j)).norm() < 0.02) continue;
                    const Eigen::Vector3d ring = Eigen::Vector3d(x(0, j), x(1, j), 0).normalized();
                    a.points.col(j) = 2 * ring - a.points.col(j);
                  }
                }),
        Closest("NOT_NORMAL",
                [](const Eigen::MatrixXd& x, Answer& a) {
                  // Turned about the axis, the more the farther away.
                  for (Eigen::Index j = 0; j < x.cols(); ++j) {
                    const double angle = 0.3 * (x.col(j) - a.points.col(j)).norm();
                    a.points.col(j) = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()) *
                                      Eigen::Vector3d(a.points.col(j));
                  }
                }),
        Tangents("TANGENT_NOT_ORTHONORMAL", [](Eigen::MatrixXd& bases) { bases *= 1.01; }),
        Tangents("TANGENT_WRONG",
                 [](Eigen::MatrixXd& bases) {
                   // Laid out by vectors instead of coordinates.
                   for (auto basis : bases.colwise()) {
                     const Eigen::Matrix<double, 6, 1> right = basis;
                     basis << right[0], right[2], right[4], right[1], right[3], right[5];
                     Eigen::Map<Eigen::Matrix<double, 3, 2, Eigen::RowMajor>> turned(basis.data());
                     turned.col(0).normalize();
                     turned.col(1) -= turned.col(0) * turned.col(0).dot(turned.col(1));
                     turned.col(1).normalize();
                   }
                 }),
        Sizes("SIZE_WRONG", [](Eigen::VectorXd& sizes) { sizes[sizes.size() / 2] = 0; }),
        Sizes("SIZE_CHANGES",
              [calls = 0](Eigen::VectorXd& sizes) mutable { sizes *= 1 + 1e-3 * ++calls; }),
        Flats("FLAT_MISSED", [](const auto&, const auto&, const auto&,
                                Answer& a) { a.found.assign(a.found.size(), 0); }),
        Flats("FLAT_OFF",
              [](const auto&, const Eigen::MatrixXd& bases, const auto&, Answer& a) {
                for (int i = 0; i < 3; ++i) a.points.row(i) += 0.01 * bases.row(2 * i);
              }),
        Flats("FLAT_OFF_MANIFOLD", [](const Eigen::MatrixXd& centers, const auto&, const auto&,
                                      Answer& a) { a.points = 0.9 * a.points + 0.1 * centers; }),
        Flats("FLAT_NOT_NEAREST", [](const Eigen::MatrixXd& centers, const auto&, const auto&,
                                     Answer& a) { a.points += 1.2 * (a.points - centers); }),
        Flats("FLAT_OUTSIDE_RADIUS",
              [](const Eigen::MatrixXd& centers, const auto&, const Eigen::VectorXd& radii,
                 Answer& a) {
                for (size_t j = 0; j < a.found.size(); ++j) {
                  const Eigen::Index i = static_cast<Eigen::Index>(j);
                  a.points.col(i) = centers.col(i) + 1.5 * radii[i] * Eigen::Vector3d::UnitZ();
                  a.found[j] = 1;
                }
              })),
    [](const auto& broken) { return broken.param.code; });

class GoodOracle : public ::testing::TestWithParam<std::string> {};

TEST_P(GoodOracle, Passes) {
  const auto manifold = MakeManifold(GetParam()).value();
  ASSERT_NE(manifold, nullptr);
  const ExaminationReport report = Examine(*manifold, 0.1);
  for (const Finding& finding : report.findings) {
    const std::set<std::string> harmless = {"REACH", "PIECES", "SPEED", "SLOW", "COARSE_EPSILON"};
    EXPECT_EQ(harmless.count(finding.code), 1u) << ToText(report);
  }
  const ManifoldFacts& facts = manifold->facts();
  EXPECT_EQ(report.pieces, facts.betti_mod2[0]);
  ASSERT_TRUE(report.reach.has_value());
  if (facts.reach) {
    EXPECT_GT(*report.reach, 0.9 * *facts.reach);
  }
  ASSERT_FALSE(report.rates.empty());
  EXPECT_GT(report.best_batch, 0);
}

std::vector<std::string> Examples() {
  std::vector<std::string> specs = {"sphere:2:40", "so3@12", "ellipsoid:2:1"};
  for (const CatalogueEntry& entry : ListManifolds()) specs.push_back(entry.example);
  return specs;
}
INSTANTIATE_TEST_SUITE_P(Catalogue, GoodOracle, ::testing::ValuesIn(Examples()));

TEST(Examiner, ComparesEpsilonWithTheReach) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  const ExaminationReport coarse = Examine(*torus, 0.3);
  EXPECT_TRUE(coarse.ok());
  EXPECT_NE(Find(coarse, "COARSE_EPSILON"), nullptr);
  EXPECT_NEAR(*coarse.reach, 0.4, 0.02);
  EXPECT_EQ(Find(Examine(*torus, 0.1), "COARSE_EPSILON"), nullptr);
}

TEST(ChooseEpsilon, IsAQuarterOfTheReachWhateverTheUnit) {
  for (const auto& [spec, expected] :
       {std::pair("torus:1:0.4", 0.1), std::pair("torus:1000:400", 100.0)}) {
    const auto manifold = MakeManifold(spec).value();
    const ChosenEpsilon chosen = ChooseEpsilon(Examine(*manifold));
    EXPECT_EQ(chosen.failure, "");
    EXPECT_NEAR(chosen.epsilon, expected, 0.05 * expected);
    EXPECT_EQ(chosen.reason.rfind("a quarter of the reach, about ", 0), 0u) << chosen.reason;
  }
}

TEST(ChooseEpsilon, RefusesAnOracleThatBreaksItsContract) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  SpoiledOracle oracle(*torus);
  oracle.on_closest = [](const Eigen::MatrixXd& x, Answer& a) { a.points = (a.points + x) / 2; };
  const ChosenEpsilon chosen = ChooseEpsilon(Examine(oracle));
  EXPECT_EQ(chosen.epsilon, 0);
  EXPECT_EQ(chosen.failure, "ORACLE_BREAKS_CONTRACT");
  EXPECT_NE(chosen.reason.find("error NOT_IDEMPOTENT"), std::string::npos) << chosen.reason;
  EXPECT_EQ(chosen.reason.find("note "), std::string::npos) << chosen.reason;
}

struct Ended {
  const char* about;
  double epsilon, reach;  // that the certificate shows
  double finer = 0;       // 0: none
  core::Termination termination = core::Termination::kConverged;
  bool certified = false, refuted = false;
};

TEST(ChooseFinerEpsilon, IsAQuarterOfTheReachThatACertificateShows) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  using enum core::Termination;
  const Ended all[] = {
      {"a quarter", 0.1, 0.2, 0.05},
      {"no progress is an end, too", 0.1, 0.0152, 0.025, kNoProgress},
      {"never finer in one step than a quarter of before", 0.1, 0.001, 0.025},
      {"two digits, the even one where two are equally near", 0.3, 0.5, 0.12},
      {"the odd one where the even one is farther", 0.3, 0.5000001, 0.13},
      {"large lengths", 2000, 4711, 1200},
      {"certified", 0.1, 0.2, 0, kConverged, true},
      {"the declared reach is wrong", 0.1, 0.2, 0, kConverged, false, true},
      {"fine enough: what was refused is something else", 0.1, 0.26},
      {"nothing bends", 0.1, kInfinity},
      {"no reach was seen", 0.1, 0},
      {"a mesh of points has no epsilon", 0, 0.2},
      {"the budget ended it", 0.1, 0.2, 0, kVertexBudget},
      {"it was cancelled", 0.1, 0.2, 0, kCancelled},
  };
  for (const Ended& ended : all) {
    SCOPED_TRACE(ended.about);
    core::Report report;
    report.termination = ended.termination;
    report.certificate.estimated_reach = ended.reach;
    report.certificate.certified = ended.certified;
    report.certificate.reach_refuted = ended.refuted;
    const auto chosen = core::ChooseFinerEpsilon(report, ended.epsilon);
    EXPECT_EQ(chosen ? chosen->epsilon : 0, ended.finer);
  }
}

TEST(ChooseFinerEpsilon, SaysWhy) {
  core::Report report;
  report.termination = core::Termination::kConverged;
  report.certificate.estimated_reach = 4711;
  EXPECT_EQ(
      core::ChooseFinerEpsilon(report, 2000)->reason,
      "a quarter of the reach, about 4.71e+03 by the certificate of epsilon 2000, which was too "
      "coarse");
  report.certificate.estimated_reach = 0.0152;
  EXPECT_EQ(
      core::ChooseFinerEpsilon(report, 0.1)->reason,
      "no finer in one step, though a quarter of the reach, about 0.0152 by the certificate of "
      "epsilon 0.1, which was too coarse");
}

TEST(Examiner, ReadsWell) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  SpoiledOracle oracle(*torus);
  oracle.on_tangents = [](Eigen::MatrixXd& bases) { bases *= 1.01; };
  const std::string text = ToText(Examine(oracle));
  EXPECT_EQ(text.rfind("  error TANGENT_NOT_ORTHONORMAL: the tangent basis at [", 0), 0u) << text;
  EXPECT_NE(text.find("The oracle breaks its contract: 1 error, 0 warnings"), std::string::npos)
      << text;
  std::size_t longest = 0;
  for (std::size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find('\n', begin);
    longest = std::max(longest, std::min(end, text.size()) - begin);
  }
  EXPECT_LE(longest, 100u) << text;
}

TEST(Examiner, NamesPlaceAndNumbers) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  SpoiledOracle oracle(*torus);
  oracle.on_tangents = [](Eigen::MatrixXd& bases) { bases *= 1.01; };
  const ExaminationReport report = Examine(oracle);
  const Finding* const finding = Find(report, "TANGENT_NOT_ORTHONORMAL");
  ASSERT_NE(finding, nullptr);
  ASSERT_EQ(finding->place.size(), 3);
  const double off =
      std::hypot(std::hypot(finding->place[0], finding->place[1]) - 1, finding->place[2]);
  EXPECT_NEAR(off, 0.4, 1e-9);  // on the torus
  ASSERT_EQ(finding->numbers.size(), 1u);
  EXPECT_EQ(finding->numbers[0].first, "off");
  EXPECT_NEAR(finding->numbers[0].second, 0.0201, 1e-6);
}

// All queries, and what was found but for speed.
std::string Story(std::uint64_t seed) {
  const auto so3 = MakeManifold("so3").value();
  core::Specification spec = testing::ExaminationOf(*so3);
  spec.random_seed = seed;
  const auto examiner = core::Examiner::Create(spec, 0.3);
  std::string story;
  while (const auto batch = examiner->NextBatch()) {
    const Eigen::MatrixXd& points = batch->blocks[0].points;
    story.append(reinterpret_cast<const char*>(points.data()),
                 static_cast<std::size_t>(points.size()) * sizeof(double));
    EXPECT_TRUE(examiner->Absorb(testing::AnswersOf(*so3, *batch), 0).ok());
  }
  EXPECT_TRUE(examiner->report().rates.empty());  // nobody measured
  return story + ToText(examiner->report());
}

TEST(Examiner, AsksTheSameOfTheSame) {
  EXPECT_EQ(Story(1), Story(1));
  EXPECT_NE(Story(1), Story(2));
}

TEST(Examiner, MeasuresSpeedByTheSecondsThatItIsGiven) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  const auto examiner = core::Examiner::Create(testing::ExaminationOf(*torus), std::nullopt);
  while (const auto batch = examiner->NextBatch()) {
    const double seconds = 0.01 + 0.001 * static_cast<double>(batch->size());
    ASSERT_TRUE(examiner->Absorb(testing::AnswersOf(*torus, *batch), seconds).ok());
  }
  const ExaminationReport& report = examiner->report();
  ASSERT_EQ(report.rates.size(), 4u);  // a thousand take a second: more would take too long
  EXPECT_NEAR(report.rates[0].queries_per_second, 1 / 0.011, 1e-9);
  EXPECT_NEAR(report.rates[3].queries_per_second, 1000 / 1.01, 1e-9);
  EXPECT_EQ(report.best_batch, 100);
  ASSERT_NE(Find(report, "SLOW"), nullptr);
  EXPECT_NE(Find(report, "SLOW")->message.find("990 queries a second"), std::string::npos)
      << Find(report, "SLOW")->message;
}

TEST(Examiner, RefusesAnswersOfAnotherShapeAndKeepsTheBatch) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  const auto examiner = core::Examiner::Create(testing::ExaminationOf(*torus), std::nullopt);
  const auto batch = examiner->NextBatch();
  core::Answers answers = testing::AnswersOf(*torus, *batch);
  const core::Answers right = answers;
  answers.blocks[0].points.conservativeResize(3, batch->size() - 1);
  EXPECT_EQ(examiner->Absorb(answers, 1).code, core::StatusCode::kOracleShape);
  EXPECT_EQ(examiner->Absorb({}, 1).code, core::StatusCode::kFailedPrecondition);
  EXPECT_EQ(examiner->NextBatch(), batch);
  EXPECT_TRUE(examiner->Absorb(right, 1).ok());
  EXPECT_NE(examiner->NextBatch(), batch);
}

TEST(Examiner, EndsWithTheFaultOfAnOracle) {
  using Kind = core::OracleFault::Kind;
  const auto torus = MakeManifold("torus:1:0.4").value();
  for (const auto& [kind, code] :
       {std::pair(Kind::kRaised, "RAISED"), std::pair(Kind::kShape, "WRONG_SHAPE"),
        std::pair(Kind::kNotFinite, "NOT_FINITE"), std::pair(Kind::kInexact, "INEXACT"),
        std::pair(Kind::kTouchesZero, "TOUCHES_ZERO"),
        std::pair(Kind::kDerivative, "WRONG_DERIVATIVE")}) {
    const auto examiner = core::Examiner::Create(testing::ExaminationOf(*torus), std::nullopt);
    examiner->Fail({kind, "on purpose"});
    EXPECT_EQ(examiner->NextBatch(), nullptr);
    const Finding* const finding = Find(examiner->report(), code);
    ASSERT_NE(finding, nullptr) << code;
    EXPECT_NE(finding->message.find("on purpose"), std::string::npos) << finding->message;
    examiner->Fail({Kind::kRaised, "again"});
    EXPECT_EQ(examiner->report().findings.size(), 1u);
  }
}

// Whatever comes back, it ends, with queries that are numbers.
class Hostile : public ::testing::TestWithParam<int> {};

TEST_P(Hostile, AnswersAreSurvived) {
  std::mt19937_64 random(static_cast<std::uint64_t>(GetParam()));
  const auto good = MakeManifold(GetParam() % 2 == 0 ? "torus:1:0.4" : "so3").value();
  const double odd[] = {
      0, 1, -1, 1e-300, 1e300, -1e45, 1e44, kNaN, std::numeric_limits<double>::infinity()};
  const auto examiner = core::Examiner::Create(testing::ExaminationOf(*good), 1e-3);
  const auto spoil = [&](Eigen::Ref<Eigen::MatrixXd> numbers) {
    for (double& number : numbers.reshaped())
      if (random() % 1000 < 2) number = odd[random() % std::size(odd)];
  };
  int batches = 0;
  while (const auto batch = examiner->NextBatch()) {
    ASSERT_LT(++batches, 2000);
    ASSERT_TRUE(batch->blocks[0].points.allFinite());
    core::Answers answers = testing::AnswersOf(*good, *batch);
    core::AnswerBlock& answer = answers.blocks[0];
    if (random() % 8 == 0) spoil(answer.points);
    if (random() % 4 == 0) spoil(answer.tangents);
    if (GetParam() % 5 == 0) answer.points.colwise() = answer.points.col(0).eval();
    if (random() % 6 == 0) answer.found.assign(static_cast<std::size_t>(batch->size()), 0);
    ASSERT_TRUE(examiner->Absorb(answers, 1).ok());
  }
  EXPECT_FALSE(examiner->report().findings.empty());
}
INSTANTIATE_TEST_SUITE_P(Seeds, Hostile, ::testing::Range(0, 60));

}  // namespace
}  // namespace stellate
