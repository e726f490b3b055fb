#include "core/certificate/claims/rounding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

#include "core/base/random.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::AnswersOf;
using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::SpecificationFor;

// Coordinates up to 1.6 in size.
Eigen::MatrixXd Points() {
  Random random(7, 1);
  Eigen::MatrixXd points(3, 200);
  for (double& x : points.reshaped()) x = 1.6 * (2 * random.Uniform() - 1);
  return points;
}

double AsText(double x, const char* format) {
  char text[64];
  std::snprintf(text, sizeof text, format, x);
  return std::strtod(text, nullptr);
}

Eigen::MatrixXd Written(Eigen::MatrixXd points, const char* format) {
  return points.unaryExpr([format](double x) { return AsText(x, format); });
}

TEST(Rounding, OfDoublesIsNone) { EXPECT_EQ(RoundingOf(Points(), 1), 0); }

TEST(Rounding, BoundsWhatItDid) {
  const Eigen::MatrixXd points = Points();
  const double most = points.colwise().norm().maxCoeff();
  for (const char* format : {"%.3g", "%.6g", "%.9g", "%.4f", "%.6f", "%.5e"}) {
    const Eigen::MatrixXd rounded = Written(points, format);
    const double moved = (rounded - points).colwise().norm().maxCoeff();
    EXPECT_GE(RoundingOf(rounded, 1), moved) << format;
    EXPECT_LE(RoundingOf(rounded, 1), 12 * moved) << format;
  }
  const Eigen::MatrixXd single = points.cast<float>().cast<double>();
  const double moved = (single - points).colwise().norm().maxCoeff();
  EXPECT_GE(RoundingOf(single, 1), moved);
  EXPECT_LE(RoundingOf(single, 1), 1e-7 * most);
}

TEST(Rounding, IsNotToldFromAFewShortNumbers) {
  EXPECT_EQ(RoundingOf(Eigen::MatrixXd::Identity(3, 3), 1), 0);
  EXPECT_EQ(RoundingOf(Eigen::MatrixXd::Zero(3, 200), 1), 0);
  EXPECT_EQ(RoundingOf(Eigen::MatrixXd(3, 0), 1), 0);
}

TEST(Rounding, IsNotToldFromAGrid) {
  const Eigen::MatrixXd grid = Written(Points(), "%.1f");
  EXPECT_GT(RoundingOf(grid, 1), 0.05);
  EXPECT_EQ(RoundingOf(grid, 0.05), 0);
}

DrivenRun MeshedAsText(const std::string& name, double epsilon, std::uint64_t seed,
                       const char* format) {
  const auto manifold = Make(name);
  Specification spec = SpecificationFor(*manifold, epsilon);
  spec.oracle.tangent_basis = spec.oracle.intersect_flat = false;
  spec.random_seed = seed;
  return Drive(spec, [&](const QueryBatch& batch) {
    Answers answers = AnswersOf(*manifold, batch);
    for (AnswerBlock& block : answers.blocks) block.points = Written(block.points, format);
    return answers;
  });
}

// Rounded points give themselves for nearest points, and near them a rounded M has sheets.
TEST(Rounding, ToSixDigitsIsNoSecondSheet) {
  for (const auto& [name, epsilon] :
       {std::pair{"sphere", 0.3}, {"sphere", 0.25}, {"torus:1:0.4", 0.25}, {"torus:1:0.4", 0.2}})
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      const DrivenRun run = MeshedAsText(name, epsilon, seed, "%.6g");
      EXPECT_TRUE(run.report().certificate.certified)
          << name << " " << epsilon << " " << seed << ": " << run.report().certificate.verdict;
    }
}

}  // namespace
}  // namespace stellate::core
