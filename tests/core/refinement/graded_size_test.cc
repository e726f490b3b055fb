// Sizes that follow the local feature size: finer where M bends more, and only there.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "core/geometry/simplex.h"
#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::Drive;
using testing::DrivenRun;
using testing::Make;
using testing::SameMesh;
using testing::SpecificationFor;
using testing::TopologyOf;

constexpr double kTube = 0.9;  // of a torus of radius 1: its reach is 0.1, at the hole alone

// The radius of curvature of that torus: the tube's, or that of the circles around the axis.
double CurvatureRadius(const double* p) {
  const double from_axis = std::hypot(p[0], p[1]);
  const double cosine = std::abs(from_axis - 1) / kTube;
  return cosine > 0 ? std::min(kTube, from_axis / cosine) : kTube;
}

void ExpectOneCertified(const DrivenRun& run, std::int64_t euler_characteristic) {
  ASSERT_EQ(run.report().termination, Termination::kConverged);
  EXPECT_TRUE(run.report().certificate.certified) << run.report().certificate.verdict;
  const auto topology = TopologyOf(run.mesher->Simplices(), run.mesher->specification().dimension);
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.components, 1u);
  EXPECT_EQ(topology.euler_characteristic, euler_characteristic);
}

TEST(GradedSize, FollowsTheCurvatureOfAThinTorus) {
  const double rate = 0.4;
  const auto torus = Make("torus:1:0.9");
  Specification spec = SpecificationFor(*torus, 0.5);
  spec.criteria.size_rate = rate;
  const DrivenRun graded = Drive(spec, *torus);
  ExpectOneCertified(graded, 0);
  // As fine everywhere as at the hole.
  const DrivenRun uniform = Drive(SpecificationFor(*torus, rate * (1 - kTube)), *torus);
  ExpectOneCertified(uniform, 0);
  EXPECT_LT(8 * graded.report().counts.vertices, uniform.report().counts.vertices);
  EXPECT_LE(graded.report().certificate.epsilon_over_reach, 1.0);
  EXPECT_TRUE(graded.report().certificate.warnings.empty())
      << graded.report().certificate.warnings.front();

  // The size is an estimate, from the edges of the stars: true to half of it.
  const Eigen::MatrixXd points = graded.mesher->Points();
  const std::vector<std::uint32_t> ids = graded.mesher->Simplices();
  double largest = 0, smallest = std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < ids.size(); s += 3) {
    const double* corners[3];
    double size = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 3; ++i) {
      corners[i] = points.col(ids[s + static_cast<std::size_t>(i)]).data();
      size = std::min(size, CurvatureRadius(corners[i]));
    }
    const double radius = MeasureSimplex(SimplexVertices(corners, 3), 3).circumradius;
    EXPECT_LE(radius, 1.5 * rate * size) << "triangle " << s / 3;
    largest = std::max(largest, radius);
    smallest = std::min(smallest, radius);
  }
  EXPECT_GT(largest, 6 * smallest);
}

TEST(GradedSize, SparesMostOfALongEllipsoid) {
  const auto ellipsoid = Make("ellipsoid:1:1:10");  // radius of curvature 0.1 at the tips
  Specification spec = SpecificationFor(*ellipsoid, 0.8);
  spec.criteria.size_rate = 0.4;
  const DrivenRun graded = Drive(spec, *ellipsoid);
  ExpectOneCertified(graded, 2);
  const DrivenRun uniform = Drive(SpecificationFor(*ellipsoid, 0.08), *ellipsoid);
  EXPECT_LT(5 * graded.report().counts.vertices, uniform.report().counts.vertices);
}

TEST(GradedSize, KeepsToADeviation) {
  const auto torus = Make("torus:1:0.9");
  for (const double deviation : {0.02, 0.005}) {
    Specification spec = SpecificationFor(*torus, 0.5);
    spec.criteria.max_deviation = deviation;
    const DrivenRun run = Drive(spec, *torus);
    ExpectOneCertified(run, 0);
    EXPECT_LE(run.report().certificate.max_barycentre_distance, deviation);
    EXPECT_GT(run.report().certificate.max_barycentre_distance, deviation / 10) << "far too fine";
  }
}

double LargestBarycentreDistance(const DrivenRun& run, Manifold& surface) {
  const Eigen::MatrixXd points = run.mesher->Points();
  const std::vector<std::uint32_t> ids = run.mesher->Simplices();
  Eigen::MatrixXd barycentres = Eigen::MatrixXd::Zero(3, static_cast<Eigen::Index>(ids.size() / 3));
  for (std::size_t i = 0; i < ids.size(); ++i)
    barycentres.col(static_cast<Eigen::Index>(i / 3)) += points.col(ids[i]) / 3;
  return surface.Distance(barycentres).maxCoeff();
}

// At the tips, of radius of curvature 0.1, M bends twice as much as a star's edges show: what is
// farther away than it may be is mended once the certificate sees it.
TEST(GradedSize, KeepsToADeviationWhereItBendsMoreThanTheVerticesShow) {
  const auto ellipsoid = Make("ellipsoid:1:1:10");
  for (const double deviation : {0.05, 0.02, 0.01, 0.005}) {
    SCOPED_TRACE(deviation);
    Specification spec = SpecificationFor(*ellipsoid, 0.8);
    spec.criteria.max_deviation = deviation;
    const DrivenRun run = Drive(spec, *ellipsoid);
    const Certificate& c = run.report().certificate;
    if (deviation > 0.02) {  // too coarse for the tips
      EXPECT_FALSE(c.certified);
      continue;
    }
    ExpectOneCertified(run, 2);
    EXPECT_LE(LargestBarycentreDistance(run, *ellipsoid), deviation * (1 + 1e-9));
  }
}

TEST(GradedSize, IsDeterministicForAnyNumberOfThreads) {
  const auto torus = Make("torus:1:0.9");
  Specification spec = SpecificationFor(*torus, 0.5);
  spec.criteria.size_rate = 0.5;
  const DrivenRun one = Drive(spec, *torus, {.threads = 1});
  EXPECT_TRUE(SameMesh(*one.mesher, *Drive(spec, *torus, {.threads = 3}).mesher));
}

TEST(GradedSize, IsNoFinerThanEpsilonWhereNothingBends) {
  const auto sphere = Make("sphere:2");
  Specification spec = SpecificationFor(*sphere, 0.3);
  const auto plain = Drive(spec, *sphere).report().counts.vertices;
  spec.criteria.size_rate = 0.9;  // of a radius of 1: epsilon decides
  EXPECT_EQ(Drive(spec, *sphere).report().counts.vertices, plain);
}

TEST(GradedSize, RefusesWhatMakesNoSense) {
  const auto sphere = Make("sphere:2");
  const Specification good = SpecificationFor(*sphere, 0.3);
  for (const double bad : {0.0, -1.0, 1.5, std::nan("")}) {
    Specification spec = good;
    spec.criteria.size_rate = bad;
    EXPECT_EQ(Validate(spec).code, StatusCode::kInvalidArgument) << bad;
  }
  for (const double bad : {0.0, -1.0, HUGE_VAL, std::nan("")}) {
    Specification spec = good;
    spec.criteria.max_deviation = bad;
    EXPECT_EQ(Validate(spec).code, StatusCode::kInvalidArgument) << bad;
  }
}

}  // namespace
}  // namespace stellate::core
