#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "core/base/name_point.h"
#include "core/reconstruction.h"
#include "tests/core/reconstruction/requests.h"
#include "tests/reconstruction/judge.h"
#include "tests/reconstruction/samples.h"

namespace stellate::core {
namespace {

using Eigen::MatrixXd;
using testing::Count;
using testing::Draw;
using testing::IsRight;
using testing::Sample;

TEST(Refusal, NamesTheFieldAndTheValue) {
  const MatrixXd points = Draw(Of("s2", 100, false)).points;
  const auto refused = [&](ReconstructionSpecification spec, const PointCloud& cloud,
                           const char* field, const char* word) {
    const auto result = Reconstruct(spec, cloud);
    ASSERT_FALSE(result) << field;
    EXPECT_EQ(result.error().field, field);
    EXPECT_NE(result.error().message.find(word), std::string::npos) << result.error().message;
  };
  ReconstructionSpecification spec = SpecOf(0, 3);
  refused(spec, {points, {}}, "dimension", "at least 1");
  spec.dimension = kMaxReconstructionDimension + 1;
  spec.ambient_dimension = 9;
  refused(spec, {MatrixXd::Random(9, 100), {}}, "dimension", "up to");
  refused(SpecOf(3, 3), {points, {}}, "dimension", "less than d");
  refused(SpecOf(2, 4), {points, {}}, "points", "3 coordinates");
  refused(SpecOf(2, 3), {points.leftCols(3), {}}, "points", "at least 4");
  refused(SpecOf(2, 3), {points, MatrixXd::Zero(6, 100)}, "tangents", "not orthonormal");
  refused(SpecOf(2, 3), {points, MatrixXd::Zero(6, 99)}, "tangents", "100 bases");
  spec = SpecOf(2, 3);
  spec.drop = .6;
  refused(spec, {points, {}}, "drop", "0.6");
  spec = SpecOf(2, 3);
  spec.noise = -1;
  refused(spec, {points, {}}, "noise", "-1");
  spec = SpecOf(2, 3);
  spec.reach = 0;
  refused(spec, {points, {}}, "reach", "0");
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e200}) {
    MatrixXd spoiled = points;
    spoiled(1, 17) = bad;
    refused(SpecOf(2, 3), {spoiled, {}}, "points", "point 17");
  }
}

TEST(Degenerate, EqualPointsAreMerged) {
  const Sample sample = Draw(Of("torus", 1000, true));
  const Eigen::Index n = sample.points.cols();
  MatrixXd points(3, n + 5);
  points.leftCols(n) = sample.points;
  points.rightCols(5) = sample.points.middleCols(10, 5);
  const auto result = Reconstruct(SpecOf(2, 3), {points, {}});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->report.certificate.certified) << result->report.certificate.verdict;
  ASSERT_EQ(result->merged.size(), 5u);
  for (std::uint32_t i = 0; i < 5; ++i) {
    EXPECT_EQ(result->merged[i], std::pair(static_cast<std::uint32_t>(n) + i, 10 + i));
    EXPECT_EQ(result->places[static_cast<std::size_t>(n) + i], Place::kMerged);
  }
  const auto alone = Reconstruct(SpecOf(2, 3), {sample.points, {}});
  EXPECT_EQ(result->simplices, alone->simplices);
}

TEST(Degenerate, AllPointsEqualIsAnError) {
  const auto result = Reconstruct(SpecOf(2, 3), {MatrixXd::Constant(3, 1'000'000, .1), {}});
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, StatusCode::kInvalidArgument);
  EXPECT_NE(result.error().message.find("only 1"), std::string::npos) << result.error().message;
}

TEST(Degenerate, PointsOfALineAreNoSurface) {
  MatrixXd points(3, 200);
  for (Eigen::Index i = 0; i < 200; ++i) points.col(i) << static_cast<double>(i), 0, 0;
  const auto result = Reconstruct(SpecOf(2, 3), {points, {}});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->report.certificate.certified);
  EXPECT_GT(result->report.reconstruction->looks[1], .9);
  EXPECT_LE(result->report.reconstruction->looks[1], 1);
  // The dimension is the cause, whatever else it brings about.
  const std::string& verdict = result->report.certificate.verdict;
  EXPECT_NE(verdict.find("dimension 2: they look 1-dimensional"), std::string::npos) << verdict;
  EXPECT_LT(verdict.find("1-dimensional"), verdict.find("something is wrong")) << verdict;
}

TEST(Degenerate, PlacesAreNamedByThePointsAsTheyCame) {
  // A surface taken for a curve looks noisy, and is smoothed to the curve that it is not.
  MatrixXd points(3, 400);
  for (Eigen::Index i = 0; i < 400; ++i) {
    const double z = 1 - 2 * (static_cast<double>(i) + .5) / 400;
    const double turn = 2.399963 * static_cast<double>(i), around = std::sqrt(1 - z * z);
    points.col(i) << around * std::cos(turn), around * std::sin(turn), z;
  }
  const auto result = Reconstruct(SpecOf(1, 3), {points, {}});
  ASSERT_TRUE(result) << result.error().message;
  const std::string& verdict = result->report.certificate.verdict;
  EXPECT_NE(verdict.find("they look 2-dimensional"), std::string::npos) << verdict;
  EXPECT_NE(verdict.find("the first is point 0, " + NamePoint(points.col(0))), std::string::npos)
      << verdict;
}

// A torus as a square grid: each four neighbours are on a circle.
MatrixXd Grid(int rows, int columns) {
  MatrixXd points(4, rows * columns);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) {
      const double u = 2 * std::numbers::pi * i / rows, v = 2 * std::numbers::pi * j / columns;
      points.col(i * columns + j) << std::cos(u), std::sin(u), std::cos(v), std::sin(v);
    }
  return points;
}

TEST(Degenerate, CosphericalPointsAreSplitAlike) {
  const auto result = Reconstruct(SpecOf(2, 4), {Grid(30, 30), {}});
  ASSERT_TRUE(result) << result.error().message;
  const auto counted = Count(2, result->simplices, 900);
  EXPECT_TRUE(result->report.certificate.certified) << result->report.certificate.verdict;
  EXPECT_TRUE(counted.IsClosedManifold());
  EXPECT_EQ(counted.euler, 0);
}

TEST(Degenerate, UnitsAndPlacesChangeNothing) {
  const Sample sample = Draw(Of("torus", 1000, true));
  const auto plain = Reconstruct(SpecOf(2, 3), {sample.points, {}});
  ASSERT_TRUE(plain);
  for (const double unit : {0x1p-20, 0x1p20}) {  // exact
    const auto scaled = Reconstruct(SpecOf(2, 3), {unit * sample.points, {}});
    ASSERT_TRUE(scaled);
    EXPECT_EQ(scaled->simplices, plain->simplices) << unit;
    EXPECT_EQ(scaled->places, plain->places) << unit;
  }
  for (const double unit : {1e-6, 1e6}) {
    const auto scaled = Reconstruct(SpecOf(2, 3), {unit * sample.points, {}});
    ASSERT_TRUE(scaled);
    EXPECT_TRUE(scaled->report.certificate.certified) << unit;
  }
  const auto moved = Reconstruct(SpecOf(2, 3), {(sample.points.array() + 1e6).matrix(), {}});
  ASSERT_TRUE(moved);
  EXPECT_TRUE(moved->report.certificate.certified) << moved->report.certificate.verdict;
  EXPECT_TRUE(IsRight(Count(2, moved->simplices, SizeOf(sample.points)), sample));
}

TEST(Degenerate, FewestPoints) {
  MatrixXd corners(3, 4);
  corners << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  const auto result = Reconstruct(SpecOf(2, 3), {corners, {}});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->report.certificate.certified);
}

}  // namespace
}  // namespace stellate::core
