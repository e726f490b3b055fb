#include "support/ready_oracles.h"

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <stdexcept>

#include "stellate/catalogue.h"
#include "stellate/oracles.h"
#include "stellate/oracles/combined.h"

namespace stellate::testing {
namespace {

using namespace oracles;  // NOLINT(google-build-using-namespace): it is what this file is about
using Vector = Eigen::VectorXd;

constexpr double kTurn = 2 * std::numbers::pi;

Vector Torus(const Vector& u) {
  const double ring = 1 + 0.4 * std::cos(u[1]);
  return Eigen::Vector3d(ring * std::cos(u[0]), ring * std::sin(u[0]), 0.4 * std::sin(u[1]));
}

Eigen::MatrixXd TorusSlopes(const Vector& u) {
  const double ring = 1 + 0.4 * std::cos(u[1]);
  Eigen::MatrixXd slopes(3, 2);
  slopes.col(0) << -ring * std::sin(u[0]), ring * std::cos(u[0]), 0;
  slopes.col(1) << -0.4 * std::sin(u[1]) * std::cos(u[0]), -0.4 * std::sin(u[1]) * std::sin(u[0]),
      0.4 * std::cos(u[1]);
  return slopes;
}

// The inverse of a stereographic projection, of most of a sphere.
Chart HalfSphere(double sign) {
  const auto x = [sign](const Vector& u) -> Vector {
    const double s = u.squaredNorm();
    return Eigen::Vector3d(2 * u[0], 2 * u[1], sign * (1 - s)) / (1 + s);
  };
  return {x, {}, Eigen::Vector2d(-1.3, -1.3), Eigen::Vector2d(1.3, 1.3), {}};
}

BoundingBox Cube(int d, double half) {
  return {Vector::Constant(d, -half), Vector::Constant(d, half)};
}

double TorusDistance(const Vector& x) { return std::hypot(std::hypot(x[0], x[1]) - 1, x[2]) - 0.4; }

std::unique_ptr<Oracle> TorusGrid() {
  constexpr int kCount = 40;
  Vector values(kCount * kCount * kCount);
  const auto at = [](int i) { return -1.5 + 3.0 * i / (kCount - 1); };
  int number = 0;
  for (int i = 0; i < kCount; ++i) {
    for (int j = 0; j < kCount; ++j) {
      for (int l = 0; l < kCount; ++l) {
        values[number++] = TorusDistance(Eigen::Vector3d(at(i), at(j), at(l)));
      }
    }
  }
  return std::make_unique<SignedDistance>(
      SignedDistance::OfGrid(values, {kCount, kCount, kCount}, Cube(3, 1.5)));
}

Eigen::MatrixXd TorusCloud() {
  Eigen::MatrixXd points(3, 4000);
  for (int a = 0; a < 100; ++a) {
    for (int b = 0; b < 40; ++b) {
      const double v = b / 40.0;
      points.col(a * 40 + b) = Torus(kTurn * Eigen::Vector2d(a / 100.0 + 0.37 * v, v));
    }
  }
  return points;
}

// Closer together towards one meridian, and noisy; the same numbers in both languages.
Eigen::MatrixXd UnevenCloud() {
  Eigen::MatrixXd points(3, 4000);
  const auto part = [](double number) { return number - std::floor(number); };
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const auto number = static_cast<double>(i);
    const double u = part(0.7548776662466927 * number), v = part(0.5698402909980532 * number);
    points.col(i) =
        (1 + 0.003 * std::sin(12.9898 * number)) * Torus(kTurn * Eigen::Vector2d(u * u, v));
  }
  return points;
}

Triangles TorusTriangles() {
  constexpr int kLong = 120, kRound = 60;
  Triangles torus{Eigen::MatrixXd(3, kLong * kRound), Eigen::MatrixXi(3, 2 * kLong * kRound)};
  const auto number = [](int i, int j) { return i % kLong * kRound + j % kRound; };
  for (int i = 0; i < kLong; ++i) {
    for (int j = 0; j < kRound; ++j) {
      const int here = number(i, j);
      torus.points.col(here) = Torus(Eigen::Vector2d(kTurn * i / kLong, kTurn * j / kRound));
      torus.corners.col(2 * here) << here, number(i + 1, j), number(i + 1, j + 1);
      torus.corners.col(2 * here + 1) << here, number(i + 1, j + 1), number(i, j + 1);
    }
  }
  return torus;
}

// Turned by the same plane rotations in both languages.
std::unique_ptr<Oracle> TurnedTorus() {
  Eigen::MatrixXd rotation = Eigen::MatrixXd::Identity(5, 5);
  for (int i = 0; i < 4; ++i) {
    Eigen::MatrixXd turn = Eigen::MatrixXd::Identity(5, 5);
    turn(i, i) = turn(i + 1, i + 1) = 0.8;
    turn(i, i + 1) = -0.6;
    turn(i + 1, i) = 0.6;
    rotation = turn * rotation;
  }
  Similarity map{rotation.leftCols(3), 2, Vector::LinSpaced(5, 0, 4)};
  return std::make_unique<Transformed>(MakeManifold("torus:1:0.4").value(), map);
}

std::unique_ptr<Oracle> CurveOnTorus() {
  const auto f = [](const Vector& x) { return Vector::Constant(1, x[0] - 0.3 * x[2] - 0.1); };
  return std::make_unique<LevelSet>(MakeManifold("torus:1:0.4").value(), f);
}

// A Clifford torus by two constraints, one with its gradient.
std::unique_ptr<Oracle> Clifford() {
  const auto first = [](const Vector& x) {
    return Vector::Constant(1, x[0] * x[0] + x[1] * x[1] - 1);
  };
  const auto slope = [](const Vector& x) -> Eigen::MatrixXd {
    return Eigen::RowVector4d(2 * x[0], 2 * x[1], 0, 0);
  };
  const auto second = [](const Vector& x) {
    return Vector::Constant(1, x[2] * x[2] + x[3] * x[3] - 1);
  };
  return std::make_unique<ConstraintSet>(4, std::vector<Constraint>{{first, slope}, {second, {}}},
                                         Cube(4, 1.5));
}

std::unique_ptr<Oracle> FourBars() {
  const Linkage::Places ground = {{"a", Eigen::Vector2d(0, 0)}, {"b", Eigen::Vector2d(1.5, 0)}};
  return std::make_unique<Linkage>(
      std::vector<Bar>{{"a", "p", 1.0}, {"p", "q", 1.3}, {"q", "b", 1.1}}, ground);
}

std::unique_ptr<Oracle> TorusTimesCircle() {
  return std::make_unique<Product>(std::vector<std::shared_ptr<Oracle>>{
      MakeManifold("torus:1:0.4").value(), MakeManifold("sphere:1").value()});
}

const std::map<std::string, std::function<std::unique_ptr<Oracle>()>>& Makers() {
  const Vector zero = Vector::Zero(2), turn = Vector::Constant(2, kTurn);
  const Chart torus{Torus, TorusSlopes, zero, turn, {true}};
  static const std::map<std::string, std::function<std::unique_ptr<Oracle>()>> kMakers = {
      {"parametrized", [=] { return std::make_unique<Parametrized>(torus); }},
      {"parametrized_differences",
       [=] {
         return std::make_unique<Parametrized>(Chart{Torus, {}, zero, turn, {true}});
       }},
      {"charts",
       [] {
         return std::make_unique<Parametrized>(std::vector<Chart>{HalfSphere(1), HalfSphere(-1)});
       }},
      {"product", TorusTimesCircle},
      {"transformed", TurnedTorus},
      {"level_set", CurveOnTorus},
      {"signed_distance",
       [] {
         return std::make_unique<SignedDistance>(TorusDistance, SignedDistance::Gradient{},
                                                 Cube(3, 1.5));
       }},
      {"grid", TorusGrid},
      {"constraint_set", Clifford},
      {"linkage", FourBars},
      {"point_cloud", [] { return std::make_unique<PointCloud>(TorusCloud(), 2, 0.2); }},
      {"uneven_cloud", [] { return std::make_unique<PointCloud>(UnevenCloud(), 2); }},
      {"triangle_mesh", [] { return std::make_unique<TriangleMesh>(TorusTriangles()); }},
  };
  return kMakers;
}

}  // namespace

std::unique_ptr<Oracle> MakeReadyOracle(const std::string& name) {
  const auto found = Makers().find(name);
  if (found == Makers().end()) throw std::invalid_argument("no ready oracle " + name);
  return found->second();
}

std::vector<std::string> ReadyOracles() {
  std::vector<std::string> names;
  for (const auto& [name, make] : Makers()) names.push_back(name);
  return names;
}

}  // namespace stellate::testing
