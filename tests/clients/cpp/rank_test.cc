// Where equations lose rank: those of clients/shared/singular.json, as in Python; bars on one line;
// tips between walls.
#include "run/rank.h"

#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
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

using google::protobuf::Struct, google::protobuf::Value;
using Place = Eigen::VectorXd;

using Values = google::protobuf::RepeatedPtrField<Value>;

const Values& List(const Struct& of, const std::string& name) {
  return of.fields().at(name).list_value().values();
}

std::vector<Place> Rows(const Values& lists) {
  std::vector<Place> rows;
  for (const Value& list : lists) {
    const Values& numbers = list.list_value().values();
    Place row(numbers.size());
    for (int i = 0; i < numbers.size(); ++i) row[i] = numbers[i].number_value();
    rows.push_back(row);
  }
  return rows;
}

// Each a sum of (coefficient, exponents...), in a cube.
std::unique_ptr<Oracle> Polynomials(std::vector<std::vector<Place>> equations) {
  const auto count = std::ssize(equations);
  const auto d = equations.front().front().size() - 1;
  const auto f = [equations](const Place& x) {
    Place values = Place::Zero(std::ssize(equations));
    for (size_t i = 0; i < equations.size(); ++i)
      for (const Place& term : equations[i]) {
        double product = term[0];
        for (Eigen::Index a = 0; a < x.size(); ++a) product *= std::pow(x[a], term[a + 1]);
        values[static_cast<Eigen::Index>(i)] += product;
      }
    return values;
  };
  const Place corner = Place::Constant(d, 1.5);
  return std::make_unique<ImplicitOracle>(static_cast<int>(d - count), static_cast<int>(d), f,
                                          ImplicitOracle::Jacobian(), BoundingBox{-corner, corner});
}

std::unique_ptr<Oracle> Polynomials(const Values& equations) {
  std::vector<std::vector<Place>> all;
  for (const Value& one : equations) all.push_back(Rows(one.list_value().values()));
  return Polynomials(std::move(all));
}

// A figure with a tip at the origin.
std::unique_ptr<Oracle> Tip() {
  const Place corner = Place::Constant(3, 1.5);
  const auto f = [](const Place& x) {
    const double square = x.squaredNorm();
    return Place::Constant(1, square * square - x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
  };
  return std::make_unique<ImplicitOracle>(2, 3, f, ImplicitOracle::Jacobian(),
                                          BoundingBox{-corner, corner});
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
    ::testing::Values(Crossing{"rhombus", [] { return ThreeBars(1); },
                               [](const Place& p) { return std::abs(p[1]) + std::abs(p[3]); }},
                      Crossing{"clipped",
                               [] {
                                 return std::make_unique<oracles::Clipped>(
                                     Tip(), std::vector<oracles::Wall>{oracles::HalfSpace(
                                                Eigen::Vector3d::UnitX(), -0.5)});
                               },
                               [](const Place& p) { return p.lpNorm<1>(); }}),
    [](const auto& one) { return one.param.name; });

TEST(FindSingular, CallsBarsThatAreNearlyOnOneLineRegular) {
  EXPECT_FALSE(client::FindSingular(*ThreeBars(1.01), 1));
}

TEST(FindSingular, FindsWhatPythonFinds) {
  std::ifstream file(SHARED_FACTS "/singular.json");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  Struct shared;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(text, &shared).ok());
  for (const Value& one : List(shared, "cases")) {
    const Struct& the_case = one.struct_value();
    SCOPED_TRACE(the_case.fields().at("name").string_value());
    const std::unique_ptr<Oracle> oracle = Polynomials(List(the_case, "equations"));
    const std::optional<client::Singular> singular = client::FindSingular(*oracle, 1);
    const std::vector<Place> places = Rows(List(the_case, "singular"));
    EXPECT_EQ(singular.has_value(), !places.empty());
    if (!singular || places.empty()) continue;
    double off = std::numeric_limits<double>::infinity();
    for (const Place& place : places) off = std::min(off, (singular->place - place).lpNorm<1>());
    EXPECT_LT(off, 1e-4) << singular->place.transpose();
    EXPECT_LT(singular->ratio, 1e-5);
  }
}

TEST(FindSingular, LeavesATipAloneThatIsCutOut) {
  oracles::Clipped half(Tip(), {oracles::HalfSpace(Eigen::Vector3d::UnitX(), 0.2)});
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
