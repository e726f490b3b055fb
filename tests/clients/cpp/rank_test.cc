// Where equations lose rank: crossings, tips, bars on one line.
#include "run/rank.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "stellate/catalogue.h"
#include "stellate/oracles.h"
#include "stellate/oracles/walls.h"

namespace stellate {
namespace {

using Place = Eigen::VectorXd;

std::unique_ptr<Oracle> Equations(int count, const ImplicitOracle::Function& f) {
  const Place corner = Place::Constant(3, 1.5);
  return std::make_unique<ImplicitOracle>(3 - count, 3, f, ImplicitOracle::Jacobian(),
                                          BoundingBox{-corner, corner});
}

// A figure that has a tip at the origin, or a neck, or two parts.
std::unique_ptr<Oracle> Tip(double level, double unit = 1) {
  return Equations(1, [=](const Place& x) {
    const double square = x.squaredNorm();
    return Place::Constant(
        1, unit * (square * square - x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - level));
  });
}

std::unique_ptr<Oracle> TwoCylinders() {
  return Equations(2, [](const Place& x) {
    return Eigen::Vector2d(x[0] * x[0] + x[1] * x[1] - 1, x[0] * x[0] + x[2] * x[2] - 1);
  });
}

std::unique_ptr<Oracle> ThreeBars(double middle) {
  const oracles::Linkage::Places ground = {{"a", Eigen::Vector2d(0, 0)},
                                           {"b", Eigen::Vector2d(1, 0)}};
  return std::make_unique<oracles::Linkage>(
      std::vector<oracles::Bar>{{"a", "p", 1}, {"p", "q", middle}, {"q", "b", 1}}, ground);
}

struct Crossing {
  std::string name;
  std::function<std::unique_ptr<Oracle>()> make;
  std::function<double(const Place&)> off;  // how far from where it is singular
};
void PrintTo(const Crossing& crossing, std::ostream* out) { *out << crossing.name; }

class LosesRank : public ::testing::TestWithParam<Crossing> {};

TEST_P(LosesRank, AndIsToldWhere) {
  const std::unique_ptr<Oracle> oracle = GetParam().make();
  const std::optional<client::Singular> singular = client::FindSingular(*oracle, 1);
  ASSERT_TRUE(singular.has_value());
  EXPECT_LT(GetParam().off(singular->place), 1e-4) << singular->place.transpose();
  EXPECT_LT(singular->ratio, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(
    Equations, LosesRank,
    ::testing::Values(Crossing{"cylinders", TwoCylinders,
                               [](const Place& p) {
                                 return std::abs(std::abs(p[0]) - 1) + std::abs(p[1]) +
                                        std::abs(p[2]);
                               }},
                      Crossing{"rhombus", [] { return ThreeBars(1); },
                               [](const Place& p) { return std::abs(p[1]) + std::abs(p[3]); }},
                      Crossing{"tip", [] { return Tip(0); },
                               [](const Place& p) { return p.lpNorm<1>(); }},
                      Crossing{"small", [] { return Tip(0, 1e-9); },
                               [](const Place& p) { return p.lpNorm<1>(); }},
                      Crossing{"clipped",
                               [] {
                                 return std::make_unique<oracles::Clipped>(
                                     Tip(0), std::vector<oracles::Wall>{oracles::HalfSpace(
                                                 Eigen::Vector3d::UnitX(), -0.5)});
                               },
                               [](const Place& p) { return p.lpNorm<1>(); }}),
    [](const auto& one) { return one.param.name; });

TEST(FindSingular, CallsNoSteepOrFlatEquationsSingular) {
  const auto needle = [](const Place& x) {
    return Place::Constant(1, x.head(2).squaredNorm() + 900 * x[2] * x[2] - 1);
  };
  const std::unique_ptr<Oracle> regular[] = {Tip(1e-3), Tip(-1e-3), Equations(1, needle),
                                             ThreeBars(1.01)};
  for (const auto& oracle : regular) EXPECT_FALSE(client::FindSingular(*oracle, 1));
}

TEST(FindSingular, LeavesATipAloneThatIsCutOut) {
  oracles::Clipped half(Tip(0), {oracles::HalfSpace(Eigen::Vector3d::UnitX(), 0.2)});
  EXPECT_FALSE(client::FindSingular(half, 1));
}

TEST(FindSingular, FindsNothingWhereThereAreNoEquations) {
  EXPECT_FALSE(client::FindSingular(*MakeManifold("torus:1:0.4").value(), 1));
}

// Of a sphere, with gradients that are not.
class Misshapen final : public ImplicitOracle {
 public:
  explicit Misshapen(Eigen::MatrixXd gradients)
      : ImplicitOracle(
            2, 3, [](const Place& x) { return Place::Constant(1, x.squaredNorm() - 1); },
            Jacobian(), BoundingBox{Place::Constant(3, -1.5), Place::Constant(3, 1.5)}),
        gradients_(std::move(gradients)) {}
  Eigen::MatrixXd EquationGradients(const Eigen::MatrixXd& points) override {
    return gradients_.replicate(1, points.cols());
  }

 private:
  const Eigen::MatrixXd gradients_;
};

TEST(FindSingular, SaysWhatIsWrongWithGradients) {
  Misshapen two(Eigen::MatrixXd::Ones(2, 1));
  EXPECT_THROW(client::FindSingular(two, 1), OracleError);
  Misshapen infinite(Eigen::MatrixXd::Constant(3, 1, std::numeric_limits<double>::infinity()));
  EXPECT_THROW(client::FindSingular(infinite, 1), OracleError);
}

}  // namespace
}  // namespace stellate
