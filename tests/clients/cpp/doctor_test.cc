// Check: each broken oracle is found out by the finding that names it, and good ones pass.
#include "stellate/doctor.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <set>
#include <stdexcept>
#include <utility>

#include "stellate/catalogue.h"
#include "stellate/client.h"
#include "support/spoiled_oracle.h"

namespace stellate {
namespace {

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
  const CheckReport report = Check(oracle);
  const Finding* const finding = report.Find(GetParam().code);
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
  CheckOptions options;
  options.epsilon = 0.1;
  const CheckReport report = Check(*manifold, options);
  for (const Finding& finding : report.findings) {
    const std::set<std::string> harmless = {"REACH", "PIECES", "SPEED", "SLOW", "COARSE_EPSILON"};
    EXPECT_TRUE(harmless.count(finding.code) == 1) << ToText(report);
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

TEST(Check, EpsilonIsComparedWithTheReach) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  CheckOptions options;
  options.epsilon = 0.3;
  const CheckReport coarse = Check(*torus, options);
  EXPECT_TRUE(coarse.ok());
  EXPECT_NE(coarse.Find("COARSE_EPSILON"), nullptr);
  EXPECT_NEAR(*coarse.reach, 0.4, 0.02);
  options.epsilon = 0.1;
  EXPECT_EQ(Check(*torus, options).Find("COARSE_EPSILON"), nullptr);
}

TEST(ChooseEpsilon, IsAQuarterOfTheReachWhateverTheUnit) {
  for (const auto& [spec, expected] :
       {std::pair("torus:1:0.4", 0.1), std::pair("torus:1000:400", 100.0)}) {
    const auto manifold = MakeManifold(spec).value();
    const auto chosen = ChooseEpsilon(*manifold);
    ASSERT_TRUE(chosen.has_value()) << chosen.error().message;
    EXPECT_NEAR(chosen->epsilon, expected, 0.05 * expected);
    EXPECT_EQ(chosen->reason.rfind("a quarter of the reach, about ", 0), 0u) << chosen->reason;
  }
}

TEST(ChooseEpsilon, RefusesAnOracleThatBreaksItsContract) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  SpoiledOracle oracle(*torus);
  oracle.on_closest = [](const Eigen::MatrixXd& x, Answer& a) { a.points = (a.points + x) / 2; };
  const auto chosen = ChooseEpsilon(oracle);
  ASSERT_FALSE(chosen.has_value());
  EXPECT_EQ(chosen.error().code, ErrorCode::kOracleFailed);
  EXPECT_NE(chosen.error().message.find("error NOT_IDEMPOTENT"), std::string::npos)
      << chosen.error().message;
  EXPECT_EQ(chosen.error().message.find("note "), std::string::npos) << chosen.error().message;
}

TEST(Check, ReadsWell) {
  const auto torus = MakeManifold("torus:1:0.4").value();
  SpoiledOracle oracle(*torus);
  oracle.on_tangents = [](Eigen::MatrixXd& bases) { bases *= 1.01; };
  const std::string text = ToText(Check(oracle));
  EXPECT_EQ(text.rfind("  error TANGENT_NOT_ORTHONORMAL: the tangent basis at [", 0), 0u) << text;
  EXPECT_NE(text.find("The oracle breaks its contract: 1 error, 0 warnings"), std::string::npos)
      << text;
  size_t longest = 0;
  for (size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find('\n', begin);
    longest = std::max(longest, std::min(end, text.size()) - begin);
  }
  EXPECT_LE(longest, 100u) << text;
}

}  // namespace
}  // namespace stellate
