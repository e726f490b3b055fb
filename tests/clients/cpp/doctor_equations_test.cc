// Check where equations lose rank: crossings, tips, bars on one line.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include "stellate/catalogue.h"
#include "stellate/doctor.h"
#include "stellate/oracles.h"
#include "stellate/oracles/walls.h"
#include "support/spoiled_oracle.h"

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

// The numbers of "... near [1, 2, 3]: ...".
Place PlaceIn(const std::string& message) {
  std::vector<double> numbers;
  const char* at = message.c_str() + message.find('[');
  while (*at == '[' || *at == ',') {
    char* end = nullptr;
    numbers.push_back(std::strtod(at + 1, &end));
    at = end;
  }
  return Eigen::Map<const Place>(numbers.data(), std::ssize(numbers));
}

TEST_P(LosesRank, AndIsToldWhere) {
  const std::unique_ptr<Oracle> oracle = GetParam().make();
  const CheckReport report = Check(*oracle);
  const Finding* const finding = report.Find("SINGULAR");
  ASSERT_NE(finding, nullptr) << ToText(report);
  EXPECT_EQ(finding->severity, Severity::kError);
  EXPECT_LT(GetParam().off(PlaceIn(finding->message)), 1e-4) << finding->message;
  EXPECT_NE(finding->advice.find("no epsilon will do"), std::string::npos);
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

TEST(Check, CallsNoSteepOrFlatEquationsSingular) {
  const auto needle = [](const Place& x) {
    return Place::Constant(1, x.head(2).squaredNorm() + 900 * x[2] * x[2] - 1);
  };
  const std::unique_ptr<Oracle> regular[] = {Tip(1e-3), Tip(-1e-3), Equations(1, needle),
                                             ThreeBars(1.01)};
  for (const auto& oracle : regular) {
    const CheckReport report = Check(*oracle);
    EXPECT_EQ(report.Find("SINGULAR"), nullptr) << ToText(report);
  }
}

TEST(Check, LeavesATipAloneThatIsCutOut) {
  oracles::Clipped half(Tip(0), {oracles::HalfSpace(Eigen::Vector3d::UnitX(), 0.2)});
  const CheckReport report = Check(half);
  EXPECT_EQ(report.Find("SINGULAR"), nullptr) << ToText(report);
}

}  // namespace
}  // namespace stellate
