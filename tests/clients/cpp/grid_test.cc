// Surfaces of values on a grid, and what is said of values that hold none.
#include <gtest/gtest.h>

#include <random>

#include "stellate/oracles.h"

namespace stellate::oracles {
namespace {

using Vector = Eigen::VectorXd;

BoundingBox Cube(double half) { return {Vector::Constant(3, -half), Vector::Constant(3, half)}; }

Eigen::MatrixXd Scattered(int count, double half) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> number(-half, half);
  Eigen::MatrixXd points(3, count);
  for (double& coordinate : points.reshaped()) coordinate = number(random);
  return points;
}

// Distances to a sphere about the origin, on 9 places an axis of a cube.
Vector Ball(double radius) {
  Vector values(729);
  for (int i = 0; i < 729; ++i) {
    values[i] = Eigen::Vector3d(i / 81 - 4, i / 9 % 9 - 4, i % 9 - 4).norm() / 2 - radius;
  }
  return values;
}

TEST(SignedDistance, HasNoOtherSurfaceBeyondTheGrid) {
  for (const double sign : {1.0, -1.0, 1e3, -1e-3}) {
    SignedDistance sphere = SignedDistance::OfGrid(sign * Ball(1.2), {9, 9, 9}, Cube(2), 0);
    const Answer answer = sphere.ClosestPoint(Scattered(100, 9));
    int found = 0;
    for (Eigen::Index j = 0; j < 100; ++j) {
      if (!answer.IsFound(j)) continue;
      ++found;
      EXPECT_NEAR(answer.points.col(j).norm(), 1.2, 0.03) << sign;
    }
    EXPECT_GT(found, 50);
  }
}

TEST(SignedDistance, AnOpenBorderGoesOnToBeClipped) {
  SignedDistance sphere =
      SignedDistance::OfGrid(Ball(2.2), {9, 9, 9}, Cube(2), 0, GridBorder::kOpen);
  Eigen::MatrixXd x = Scattered(60, 1);
  x.row(0).setConstant(2);  // a side of the box, which the sphere crosses
  const Answer answer = sphere.ClosestPoint(x);
  for (Eigen::Index j = 0; j < 60; ++j) {
    ASSERT_TRUE(answer.IsFound(j));
    EXPECT_NEAR(answer.points.col(j).norm(), 2.2, 0.03);
  }
}

std::string Refusal(const Vector& values, double level) {
  try {
    SignedDistance::OfGrid(values, {9, 9, 9}, Cube(2), level);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "none";
}

bool Says(const std::string& text, const char* words) {
  return text.find(words) != std::string::npos;
}

TEST(SignedDistance, TellsOfASurfaceThatLeavesTheGrid) {
  const std::string told = Refusal(Ball(2.2), 0);
  EXPECT_TRUE(Says(told, "leaves the grid through its border, near (")) << told;
  EXPECT_TRUE(Says(told, "GridBorder::kOpen")) << told;
}

TEST(SignedDistance, TellsOfLabels) {
  const Vector mask = (Ball(1.2).array() > 0).cast<double>();
  for (const auto& [values, level] :
       {std::pair<Vector, double>{mask, 0.5}, std::pair<Vector, double>{3 + 4 * mask.array(), 5}}) {
    const std::string told = Refusal(values, level);
    EXPECT_TRUE(Says(told, "as labels and masks are")) << told;
  }
}

TEST(SignedDistance, TellsOfNumbersRoundedToTheSizeOfVoxels) {
  constexpr int kSide = 20;
  Vector values(kSide * kSide * kSide);
  for (int i = 0; i < values.size(); ++i) {
    const Eigen::Vector3d x(i / (kSide * kSide), i / kSide % kSide, i % kSide);
    values[i] = (x - Eigen::Vector3d::Constant(9.5)).norm() - 6;
  }
  const auto refusal = [&](double parts) -> std::string {
    try {
      SignedDistance::OfGrid((parts * values.array()).round() / parts, {kSide, kSide, kSide},
                             Cube(9.5), 0.1);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "none";
  };
  EXPECT_TRUE(Says(refusal(1), "rounded too coarsely")) << refusal(1);
  EXPECT_EQ(refusal(8), "none");
}

TEST(SignedDistance, TellsWhatAGridResolves) {
  Vector values(125);
  for (int i = 0; i < 125; ++i) {
    values[i] = Eigen::Vector3d(i / 25 - 2, i / 5 % 5 - 2, i % 5 - 2).norm() - 1.2;
  }
  SignedDistance sphere =
      SignedDistance::OfGrid(values, {5, 5, 5}, {-2 * Vector::Ones(3), Eigen::Vector3d(2, 2, 2)});
  EXPECT_EQ(sphere.resolution(), 1);
  EXPECT_EQ(sphere.about(), "a spline through 5 x 5 x 5 values on a grid, spacing 1");
  EXPECT_EQ(
      SignedDistance([](const Vector& x) { return x.norm() - 1; }, {}, Cube(1.5)).resolution(), 0);
}

}  // namespace
}  // namespace stellate::oracles
