#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/support/approximation.h"
#include "tests/support/make_manifold.h"
#include "tests/support/run_mesher.h"

// The laws of Chapter 4 and the promises on cost, as exponents measured over a range of epsilon.
// `tests/bench/run` prints the same over wider ranges: slopes, and with processor times dimension
// and rounds.

namespace stellate::testing {
namespace {

struct Range {
  std::string manifold;
  std::vector<double> epsilons;
};

// How test names and failures show a range.
void PrintTo(const Range& range, std::ostream* out) { *out << range.manifold; }

// All so fine that the sample is grown as a lattice: coarse meshes have more vertices for their
// epsilon.
class Slopes : public ::testing::TestWithParam<Range> {};

TEST_P(Slopes, FollowTheTheory) {
  const std::unique_ptr<Manifold> manifold = Make(GetParam().manifold);

  std::vector<double> vertices, hausdorff, angle;
  for (const double epsilon : GetParam().epsilons) {
    const FinishedRun run = RunMesher(*manifold, SpecificationFor(*manifold, epsilon));
    ASSERT_TRUE(run.report.certificate.certified)
        << "epsilon " << epsilon << ": " << run.report.certificate.verdict;
    const Approximation measured = MeasureApproximation(*manifold, run);
    vertices.push_back(static_cast<double>(run.points.cols()));
    hausdorff.push_back(measured.hausdorff);
    angle.push_back(measured.mean_angle);
    // What the mesher claims of its own mesh is what can be measured from outside.
    constexpr double kDegree = 0.017453292519943295;
    EXPECT_NEAR(run.report.certificate.max_tangent_angle_degrees * kDegree, measured.max_angle,
                1e-6);
    EXPECT_LE(run.report.certificate.max_barycentre_distance, measured.hausdorff + 1e-9);
  }

  const double k = manifold->dimension();
  EXPECT_NEAR(FitExponent(GetParam().epsilons, vertices), -k, 0.1 * k);
  EXPECT_NEAR(FitExponent(GetParam().epsilons, hausdorff), 2, 0.3);
  EXPECT_NEAR(FitExponent(GetParam().epsilons, angle), 1, 0.15);
}

INSTANTIATE_TEST_SUITE_P(Manifolds, Slopes,
                         ::testing::Values(Range{"torus-knot:2:3", {0.02, 0.01, 0.005}},
                                           Range{"torus:1:0.4", {0.06, 0.03, 0.015}},
                                           Range{"ellipsoid:1:0.8:0.6", {0.04, 0.02, 0.01}},
                                           Range{"clifford-torus", {0.064, 0.032, 0.016}},
                                           Range{"so3", {0.45, 0.34, 0.25}}));

// Every round is a round trip to the oracle, which may be far away; every query may be expensive.
TEST(Cost, OfTenThousandVerticesIsFewRoundTripsAndAboutOneQueryEach) {
  const FinishedRun run = RunMesher("torus:1:0.4", 0.019);
  const core::Counts& counts = run.report.counts;
  ASSERT_TRUE(run.report.certificate.certified) << run.report.certificate.verdict;
  EXPECT_GE(counts.vertices, 10'000u);
  EXPECT_LE(counts.rounds, 45u);
  EXPECT_LE(static_cast<double>(counts.queries), 1.25 * static_cast<double>(counts.vertices));
}

// The mesh depends on the manifold and not on the space around it.
TEST(Cost, InVerticesAndQueriesDoesNotGrowWithTheAmbientDimension) {
  const FinishedRun low = RunMesher("torus:1:0.4", 0.07), high = RunMesher("torus:1:0.4@100", 0.07);
  ASSERT_TRUE(low.report.certificate.certified) << low.report.certificate.verdict;
  ASSERT_TRUE(high.report.certificate.certified) << high.report.certificate.verdict;
  const auto ratio = [](std::uint64_t a, std::uint64_t b) {
    return static_cast<double>(a) / static_cast<double>(b);
  };
  EXPECT_NEAR(ratio(high.report.counts.vertices, low.report.counts.vertices), 1, 0.1);
  EXPECT_NEAR(ratio(high.report.counts.queries, low.report.counts.queries), 1, 0.2);
}

}  // namespace
}  // namespace stellate::testing
