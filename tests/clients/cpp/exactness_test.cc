// Functions that users write: single precision is told, whoever takes them, and wrong shapes are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <thread>

#include "stellate/catalogue.h"
#include "stellate/doctor.h"
#include "stellate/oracles.h"
#include "stellate/oracles/walls.h"

namespace stellate::oracles {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using Point = Eigen::VectorXd;
using Value = std::function<double(const Point& x)>;

double AsSingle(double number) { return static_cast<float>(number); }
Point AllAsSingle(const Point& x) { return x.cast<float>().cast<double>(); }

BoundingBox BoxOf(double center) {
  return {Point::Constant(3, center - 1.5), Point::Constant(3, center + 1.5)};
}

double UnitSphere(const Point& x) { return x.norm() - 1; }
double Leaning(const Point& x) { return x[0] - 0.3 * x[2] - 0.1; }

ImplicitOracle::Function OneOf(const Value& f) {
  return [f](const Point& x) { return Point::Constant(1, f(x)); };
}

Eigen::MatrixXd SomeQuestions(const Oracle& oracle) {
  const Eigen::Index d = oracle.ambient_dimension();
  return Eigen::MatrixXd::NullaryExpr(d, 20, [](Eigen::Index i, Eigen::Index j) {
    return std::sin(static_cast<double>(3 * i + 7 * j + 1));
  });
}

// Each oracle that takes a function of points: what makes it and asks it, and a function for it.
struct Taker {
  std::string name;
  Value f;
  std::function<std::unique_ptr<Oracle>(const Value& f)> make;
};
void PrintTo(const Taker& taker, std::ostream* out) { *out << taker.name; }

class TakesFunctions : public ::testing::TestWithParam<Taker> {
 protected:
  static void Ask(const Value& f) {
    const std::unique_ptr<Oracle> oracle = GetParam().make(f);
    const Eigen::MatrixXd x = SomeQuestions(*oracle);
    oracle->ClosestPoint(x);
    if (oracle->walls() > 0) oracle->Clearances(x);
  }
};

TEST_P(TakesFunctions, AndTellsSinglePrecision) {
  const Value f = GetParam().f;
  EXPECT_NO_THROW(Ask(f));
  const Value single[] = {[f](const Point& x) { return AsSingle(f(x)); },
                          [f](const Point& x) { return f(AllAsSingle(x)); }};
  for (const Value& inexact : single) {
    try {
      Ask(inexact);
      ADD_FAILURE() << "it was taken";
    } catch (const OracleError& e) {
      EXPECT_EQ(e.reason(), "ORACLE_PRECISION");
      EXPECT_THAT(e.what(), MatchesRegex(".* is exact to [1-9]e-(0[6-9]|10) of its box at best.*"));
    }
  }
}

std::shared_ptr<Oracle> RoundTorus() { return MakeManifold("torus:1:0.4").value(); }

INSTANTIATE_TEST_SUITE_P(
    Ready, TakesFunctions,
    ::testing::Values(
        Taker{"ImplicitOracle", UnitSphere,
              [](const Value& f) {
                return std::make_unique<ImplicitOracle>(2, 3, OneOf(f), ImplicitOracle::Jacobian(),
                                                        BoxOf(0));
              }},
        Taker{"SignedDistance", UnitSphere,
              [](const Value& f) {
                return std::make_unique<SignedDistance>(f, SignedDistance::Gradient(), BoxOf(0));
              }},
        Taker{"ConstraintSet", UnitSphere,
              [](const Value& f) {
                return std::make_unique<ConstraintSet>(3, std::vector<Constraint>{{OneOf(f), {}}},
                                                       BoxOf(0));
              }},
        Taker{"LevelSet", Leaning,
              [](const Value& f) { return std::make_unique<LevelSet>(RoundTorus(), OneOf(f)); }},
        Taker{"Clipped", Leaning,
              [](const Value& f) {
                return std::make_unique<Clipped>(RoundTorus(), std::vector<Wall>{{f}});
              }},
        Taker{"Solid", [](const Point& x) { return -UnitSphere(x); },
              [](const Value& f) {
                return std::make_unique<Solid>(std::vector<Wall>{{f}}, BoxOf(0));
              }},
        Taker{"Parametrized", [](const Point& u) { return std::sin(u[0]); },
              [](const Value& height) {
                const Chart chart{[height](const Point& u) -> Point {
                                    return Eigen::Vector3d(std::cos(u[0]), height(u),
                                                           0.3 * std::sin(2 * u[0]));
                                  },
                                  {},
                                  Point::Zero(1),
                                  Point::Constant(1, 2 * std::numbers::pi),
                                  {true}};
                return std::make_unique<Parametrized>(chart);
              }}),
    [](const auto& one) { return one.param.name; });

TEST(Exactness, IsMeasuredWhereTheBoxIs) {
  for (const double center : {0.0, 3e3}) {
    const Eigen::MatrixXd x = Eigen::MatrixXd::Constant(3, 1, center + 0.4);
    const auto sphere = [center](const Point& at) {
      return (at.array() - center).matrix().norm() - 1;
    };
    const auto single = [sphere](const Point& at) { return sphere(AllAsSingle(at)); };
    EXPECT_TRUE(SignedDistance(sphere, {}, BoxOf(center)).ClosestPoint(x).IsFound(0)) << center;
    EXPECT_THROW(SignedDistance(single, {}, BoxOf(center)).ClosestPoint(x), OracleError) << center;
  }
}

TEST(Exactness, AccusesNothingThatIsExact) {
  const Value exact[] = {
      [](const Point& x) { return std::min(UnitSphere(x), x.cwiseAbs().maxCoeff() - 0.9); },
      [](const Point& x) { return std::clamp(UnitSphere(x), -0.2, 0.2); },
      [](const Point& x) {
        return x[0] > 0.5 ? std::numeric_limits<double>::quiet_NaN() : UnitSphere(x);
      },
      [](const Point& x) { return 1e-12 * UnitSphere(x); },
      [](const Point& x) { return std::sin(40 * UnitSphere(x)); },
      [](const Point& x) { return x[2] - 1e-3; },
  };
  for (const Value& f : exact) {
    SignedDistance oracle(f, {}, BoxOf(0));
    EXPECT_NO_THROW(oracle.ClosestPoint(SomeQuestions(oracle)));
  }
}

TEST(Exactness, IsToldToAllThreads) {
  const auto single = [](const Point& x) { return UnitSphere(AllAsSingle(x)); };
  SignedDistance oracle(single, {}, BoxOf(0));
  const Eigen::MatrixXd x = SomeQuestions(oracle);
  std::atomic<int> told = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      try {
        oracle.ClosestPoint(x);
      } catch (const OracleError&) {
        ++told;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(told, 4);
}

TEST(Exactness, IsAFindingOfTheDoctors) {
  const auto single = [](const Point& x) { return UnitSphere(AllAsSingle(x)); };
  SignedDistance oracle(single, {}, BoxOf(0));
  const CheckReport report = Check(oracle).value();
  const Finding* const finding = report.Find("INEXACT");
  ASSERT_NE(finding, nullptr) << ToText(report);
  EXPECT_THAT(finding->message, HasSubstr("f is exact to"));
  EXPECT_THAT(finding->advice, HasSubstr("double precision"));
}

TEST(ImplicitOracle, SaysWhatShapeItsFunctionsHave) {
  const auto says = [](const ImplicitOracle::Function& f,
                       const ImplicitOracle::Jacobian& jacobian) {
    ImplicitOracle oracle(2, 3, f, jacobian, BoxOf(0));
    try {
      oracle.ClosestPoint(SomeQuestions(oracle));
    } catch (const OracleError& e) {
      return e.reason() + ": " + e.what();
    }
    return std::string("nothing");
  };
  EXPECT_THAT(says([](const Point& x) { return x; }, {}),
              HasSubstr("ORACLE_SHAPE: f returned 3 numbers; they have to be 1"));
  EXPECT_THAT(says(OneOf(UnitSphere), [](const Point& x) -> Eigen::MatrixXd { return x; }),
              HasSubstr("ORACLE_SHAPE: the jacobian returned a matrix 3 x 1; it has to be 1 x 3"));
}

}  // namespace
}  // namespace stellate::oracles
