#include "core/reconstruction.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/name_point.h"
#include "tests/reconstruction/judge.h"
#include "tests/reconstruction/samples.h"

namespace stellate::core {
namespace {

using Eigen::MatrixXd;
using testing::Count;
using testing::Draw;
using testing::IsRight;
using testing::Sample;
using testing::SampleRequest;

ReconstructionSpecification SpecOf(int k, int d) {
  ReconstructionSpecification spec;
  spec.dimension = k;
  spec.ambient_dimension = d;
  return spec;
}

std::uint32_t SizeOf(const MatrixXd& points) { return static_cast<std::uint32_t>(points.cols()); }

std::uint64_t Places(const Reconstruction& r, Place place) {
  return r.report.reconstruction->places[static_cast<std::size_t>(place)];
}

// ------------------------------------------------------------------ good samples

class Reconstructs : public ::testing::TestWithParam<SampleRequest> {};

TEST_P(Reconstructs, AndCertifiesTheRightManifold) {
  const Sample sample = Draw(GetParam());
  const auto result = Reconstruct(SpecOf(sample.k, sample.d), {sample.points, {}});
  ASSERT_TRUE(result) << result.error().message;
  const Certificate& certificate = result->report.certificate;
  const auto counted = Count(sample.k, result->simplices, SizeOf(sample.points));
  EXPECT_TRUE(IsRight(counted, sample)) << certificate.verdict;
  EXPECT_EQ(certificate.level, CertificateLevel::kSampled) << certificate.verdict;
  EXPECT_EQ(certificate.certified, certificate.level != CertificateLevel::kRefused);
  EXPECT_EQ(certificate.euler_characteristic, counted.euler);
  EXPECT_EQ(certificate.components, static_cast<std::uint64_t>(counted.components));
  EXPECT_EQ(certificate.orientable, counted.orientable);
  EXPECT_EQ(result->report.counts.simplices, counted.simplices);
  EXPECT_EQ(result->report.termination, Termination::kConverged);
  EXPECT_EQ(result->report.reconstruction->smoothed, GetParam().noise > 0);
}

SampleRequest Of(const char* manifold, std::uint32_t points, bool even, double noise = 0) {
  SampleRequest request;
  request.manifold = manifold;
  request.points = points;
  request.even = even;
  request.noise = noise;
  return request;
}

INSTANTIATE_TEST_SUITE_P(Curves, Reconstructs,
                         ::testing::Values(Of("circle", 60, true), Of("circle", 100, false),
                                           Of("knot", 300, true), Of("knot", 400, false),
                                           Of("knot", 400, true, .1)));
INSTANTIATE_TEST_SUITE_P(Surfaces, Reconstructs,
                         ::testing::Values(Of("s2", 400, true), Of("s2", 700, false),
                                           Of("torus", 1000, true), Of("torus", 1500, false),
                                           Of("t2", 700, true), Of("klein", 1200, true),
                                           Of("klein", 1500, false), Of("torus", 1500, true, .1),
                                           Of("klein", 1500, false, .1), Of("s2", 1500, true, .2)));
INSTANTIATE_TEST_SUITE_P(Solids, Reconstructs,
                         ::testing::Values(Of("s3", 1000, true), Of("s3", 1500, false),
                                           Of("so3", 2000, true), Of("s3", 1500, true, .1)));

// ------------------------------------------------------------------ broken samples

struct Broken {
  SampleRequest sample;
  int k;
  std::vector<Place> causes;
};

class Refuses : public ::testing::TestWithParam<Broken> {};

TEST_P(Refuses, AndNamesTheCause) {
  const Sample sample = Draw(GetParam().sample);
  const auto result = Reconstruct(SpecOf(GetParam().k, sample.d), {sample.points, {}});
  ASSERT_TRUE(result) << result.error().message;
  const Certificate& certificate = result->report.certificate;
  EXPECT_FALSE(certificate.certified) << certificate.verdict;
  // What most of the unresolved points say.
  std::uint64_t most = 0, named = 0;
  for (int place = static_cast<int>(Place::kEdge); place < kPlaces; ++place)
    most = std::max(most, Places(*result, static_cast<Place>(place)));
  for (const Place cause : GetParam().causes) named = std::max(named, Places(*result, cause));
  EXPECT_GT(named, 0u) << certificate.verdict;
  EXPECT_EQ(named, most) << certificate.verdict;
  EXPECT_NE(certificate.verdict.find("point "), std::string::npos) << certificate.verdict;
}

Broken With(SampleRequest sample, int k, std::vector<Place> causes, double gap = 0, double hole = 0,
            double outliers = 0) {
  sample.gap = gap;
  sample.hole = hole;
  sample.outliers = outliers;
  return {sample, k, std::move(causes)};
}

INSTANTIATE_TEST_SUITE_P(
    Samples, Refuses,
    ::testing::Values(With(Of("torus", 40, false), 2, {Place::kSparse, Place::kEdge}),
                      With(Of("shells", 1500, false), 2, {Place::kSheets, Place::kNoise}, .5),
                      With(Of("half", 1000, true), 2, {Place::kEdge}),
                      With(Of("torus", 3000, false), 2, {Place::kEdge}, 0, 6),
                      With(Of("torus", 1500, false), 2, {Place::kNoise, Place::kSheets}, 0, 0, .1),
                      With(Of("torus", 1500, false), 2, {Place::kNoise}, 0, 0, .01),
                      With(Of("torus", 1000, false), 1, {Place::kNoise, Place::kSparse}),
                      With(Of("knot", 400, false), 2, {Place::kEdge}),
                      With(Of("klein", 1000, false), 3, {Place::kEdge})));

// ------------------------------------------------------------------ degenerate points

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

// ------------------------------------------------------------------ boundary

// Points alone do not tell an end from a part that they are too few for: no such mesh is certified.
TEST(Boundary, IsKeptWhereStarsAreOpen) {
  const Sample sample = Draw(Of("half", 1000, true));  // of a torus: a cylinder
  ReconstructionSpecification spec = SpecOf(2, 3);
  spec.closed = false;
  const auto result = Reconstruct(spec, {sample.points, {}});
  ASSERT_TRUE(result) << result.error().message;
  const Certificate& certificate = result->report.certificate;
  const auto counted = Count(2, result->simplices, SizeOf(sample.points));
  EXPECT_EQ(certificate.level, CertificateLevel::kDecided) << certificate.verdict;
  EXPECT_FALSE(certificate.certified);
  EXPECT_EQ(counted.bad_facets, counted.rim_facets) << certificate.verdict;
  EXPECT_EQ(counted.euler, 0);
  EXPECT_EQ(counted.components, 1);
  EXPECT_EQ(certificate.euler_characteristic, 0);
  EXPECT_EQ(certificate.boundary_components, 2u);
  EXPECT_EQ(certificate.boundary_simplices, counted.rim_facets);
}

TEST(Boundary, OfACoarseSampleIsNotCertified) {
  for (const std::uint32_t points : {25u, 40u, 70u, 120u}) {
    const Sample sample = Draw(Of("torus", points, false));
    ReconstructionSpecification spec = SpecOf(2, 3);
    spec.closed = false;
    const auto result = Reconstruct(spec, {sample.points, {}});
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_FALSE(result->report.certificate.certified) << result->report.certificate.verdict;
  }
}

TEST(Boundary, IsNoneWhereTheManifoldHasNone) {
  const Sample sample = Draw(Of("torus", 1000, true));
  ReconstructionSpecification spec = SpecOf(2, 3);
  const auto closed = Reconstruct(spec, {sample.points, {}});
  spec.closed = false;
  const auto open = Reconstruct(spec, {sample.points, {}});
  ASSERT_TRUE(open && closed);
  EXPECT_EQ(open->simplices, closed->simplices);
  EXPECT_TRUE(open->report.certificate.certified) << open->report.certificate.verdict;
  EXPECT_EQ(open->report.certificate.boundary_simplices, 0u);
}

// ------------------------------------------------------------------ how it runs

TEST(Run, IsTheSameForAnyNumberOfThreads) {
  for (const SampleRequest& request :
       {Of("torus", 1500, false, .2), Of("so3", 800, false), Of("torus", 300, false)}) {
    const Sample sample = Draw(request);
    ReconstructionSpecification spec = SpecOf(sample.k, sample.d);
    spec.threads = 1;
    const auto one = Reconstruct(spec, {sample.points, {}});
    spec.threads = 8;
    const auto eight = Reconstruct(spec, {sample.points, {}});
    ASSERT_TRUE(one && eight);
    EXPECT_EQ(one->simplices, eight->simplices);
    EXPECT_EQ(one->places, eight->places);
    EXPECT_EQ(one->tangents, eight->tangents);
    EXPECT_EQ(one->smoothed, eight->smoothed);
    EXPECT_EQ(one->weights, eight->weights);
    EXPECT_EQ(one->noise, eight->noise);
    EXPECT_EQ(one->report.certificate.verdict, eight->report.certificate.verdict);
  }
}

TEST(Run, IsInterrupted) {
  const Sample sample = Draw(Of("torus", 200'000, false));
  ReconstructionWatch watch;
  std::thread other([&] {
    while (watch.progress().phase == ReconstructionPhase::kIndexing) std::this_thread::yield();
    watch.Interrupt();
  });
  const auto result = Reconstruct(SpecOf(2, 3), {sample.points, {}}, &watch);
  other.join();
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, StatusCode::kCancelled);
}

TEST(Run, ReportsItsProgress) {
  const Sample sample = Draw(Of("s2", 400, true));
  ReconstructionWatch watch;
  EXPECT_EQ(watch.progress().fraction, 0);
  ASSERT_TRUE(Reconstruct(SpecOf(2, 3), {sample.points, {}}, &watch));
  EXPECT_EQ(watch.progress().phase, ReconstructionPhase::kDone);
  EXPECT_EQ(watch.progress().fraction, 1);
}

TEST(Tangents, AreKeptWhereTheyAreGiven) {
  const Sample sample = Draw(Of("klein", 1200, true));
  const auto result = Reconstruct(SpecOf(2, 4), {sample.points, sample.tangents});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->tangents, sample.tangents);
  EXPECT_TRUE(IsRight(Count(2, result->simplices, SizeOf(sample.points)), sample));
}

// ------------------------------------------------------------------ declared reach

TEST(DeclaredReach, ProvesFromGivenTangents) {
  for (const SampleRequest& request : {Of("torus", 1500, true), Of("circle", 60, true)}) {
    const Sample sample = Draw(request);
    ReconstructionSpecification spec = SpecOf(sample.k, sample.d);
    spec.noise = 0;
    spec.reach = sample.reach;
    const PointCloud cloud{sample.points, sample.tangents};
    auto result = Reconstruct(spec, cloud);
    ASSERT_TRUE(result);
    const Certificate& proved = result->report.certificate;
    EXPECT_EQ(proved.level, CertificateLevel::kProved)
        << proved.verdict << (proved.warnings.empty() ? "" : proved.warnings.front());
    EXPECT_GT(proved.proved_distance, 0);
    EXPECT_LT(proved.proved_distance, sample.reach / 4);
    spec.reach = 2.5 * sample.reach;
    result = Reconstruct(spec, cloud);
    ASSERT_TRUE(result);
    EXPECT_TRUE(result->report.certificate.reach_refuted) << result->report.certificate.verdict;
    EXPECT_FALSE(result->report.certificate.certified);
    spec.reach = sample.reach;
    spec.noise.reset();  // nothing says that the points are on M
    result = Reconstruct(spec, cloud);
    ASSERT_TRUE(result);
    EXPECT_EQ(result->report.certificate.level, CertificateLevel::kSampled);
  }
}

TEST(DeclaredReach, ProvesThreeManifoldsByWeightsThatExude) {
  const Sample sample = Draw(Of("so3", 1800, true));
  ReconstructionSpecification spec = SpecOf(3, 9);
  spec.noise = 0;
  spec.reach = sample.reach;
  const auto result = Reconstruct(spec, {sample.points, sample.tangents});
  ASSERT_TRUE(result);
  const Certificate& proved = result->report.certificate;
  EXPECT_EQ(proved.level, CertificateLevel::kProved)
      << proved.verdict << (proved.warnings.empty() ? "" : proved.warnings.front());
  EXPECT_TRUE(IsRight(Count(3, result->simplices, SizeOf(sample.points)), sample));
  EXPECT_GT(Places(*result, Place::kWeighted), 0u);
}

// ------------------------------------------------------------------ weights alone

TEST(WeightsAlone, MakeTheWeightedComplex) {
  for (const SampleRequest& request :
       {Of("knot", 300, true), Of("torus", 1000, true), Of("torus", 1500, false),
        Of("klein", 1200, true, .1), Of("so3", 1000, true)}) {
    const Sample sample = Draw(request);
    ReconstructionSpecification spec = SpecOf(sample.k, sample.d);
    spec.weights = Weighting::kOnly;
    const auto result = Reconstruct(spec, {sample.points, {}});
    ASSERT_TRUE(result) << result.error().message;
    const Certificate& certificate = result->report.certificate;
    EXPECT_TRUE(certificate.certified) << request.manifold << ": " << certificate.verdict;
    EXPECT_TRUE(IsRight(Count(sample.k, result->simplices, SizeOf(sample.points)), sample));
    EXPECT_EQ(result->report.reconstruction->doubtful, 0u);
    EXPECT_EQ(result->report.reconstruction->tiles, 0u);
    // Slivers are gone: such tetrahedra tilt by nearly a right angle.
    EXPECT_LE(certificate.max_tangent_angle_degrees, 65.001);
    const std::uint64_t weighted = Places(*result, Place::kWeighted);
    EXPECT_EQ(Places(*result, Place::kOk) + weighted, SizeOf(sample.points));
    EXPECT_EQ(weighted > 0, sample.k > 1);
    for (std::size_t p = 0; p < result->places.size(); ++p)
      EXPECT_EQ(result->weights[p] > 0, result->places[p] == Place::kWeighted);
  }
}

TEST(WeightsAlone, AreRefusedWhereNoneExist) {
  const Sample sample = Draw(Of("torus", 300, false));
  ReconstructionSpecification spec = SpecOf(2, 3);
  spec.weights = Weighting::kOnly;
  spec.drop = .5;
  spec.steiner = true;
  const auto result = Reconstruct(spec, {sample.points, {}});
  ASSERT_TRUE(result) << result.error().message;
  const Certificate& certificate = result->report.certificate;
  EXPECT_FALSE(certificate.certified);
  EXPECT_NE(certificate.verdict.find("No weights were found by which all stars agree"),
            std::string::npos)
      << certificate.verdict;
  EXPECT_GT(result->report.reconstruction->unfilled_vertices, 0u);
  EXPECT_GT(Places(*result, Place::kSparse) + Places(*result, Place::kDisagree), 0u);
  EXPECT_EQ(Places(*result, Place::kDropped), 0u);
  EXPECT_EQ(Places(*result, Place::kTiled), 0u);
  EXPECT_EQ(result->added.cols(), 0);
}

// ------------------------------------------------------------------ added points

TEST(AddedPoints, MakeStarsAgreeWhereNothingElseDoes) {
  const Sample sample = Draw(Of("torus", 300, false));
  const auto n = static_cast<std::size_t>(sample.points.cols());
  ReconstructionSpecification spec = SpecOf(2, 3);
  spec.drop = 0;
  const auto without = Reconstruct(spec, {sample.points, {}});
  ASSERT_TRUE(without);
  ASSERT_GT(without->report.reconstruction->unfilled_vertices, 0u);
  ASSERT_EQ(without->report.certificate.level, CertificateLevel::kRefused);
  spec.steiner = true;
  const auto result = Reconstruct(spec, {sample.points, {}});
  ASSERT_TRUE(result);
  const auto added = static_cast<std::size_t>(result->added.cols());
  ASSERT_GT(added, 0u);
  EXPECT_LE(added, MostAdded(spec, n));
  EXPECT_EQ(result->report.reconstruction->unfilled_vertices, 0u);
  EXPECT_TRUE(IsRight(Count(2, result->simplices, static_cast<std::uint32_t>(n + added)), sample))
      << result->report.certificate.verdict;
  EXPECT_EQ(result->report.counts.vertices, n + added);
  // They come last, and are near the torus: so coarse a sample leaves a part of the spacing.
  ASSERT_EQ(result->places.size(), n + added);
  for (std::size_t p = 0; p < n + added; ++p)
    EXPECT_EQ(result->places[p] == Place::kAdded, p >= n) << p;
  for (const Eigen::Vector3d x : result->added.colwise()) {
    const double wide = std::hypot(x[0], x[1]) - 1;
    EXPECT_NEAR(std::hypot(wide, x[2]), .4, .25 * sample.Spacing());
  }
  EXPECT_NE(
      std::find_if(
          result->report.certificate.warnings.begin(), result->report.certificate.warnings.end(),
          [](const std::string& w) { return w.find("none of the points") != std::string::npos; }),
      result->report.certificate.warnings.end());
  spec.threads = 3;
  EXPECT_EQ(Reconstruct(spec, {sample.points, {}})->simplices, result->simplices);
}

TEST(AddedPoints, AreNoneWhereStarsAgree) {
  const Sample sample = Draw(Of("torus", 1000, true));
  ReconstructionSpecification spec = SpecOf(2, 3);
  const auto without = Reconstruct(spec, {sample.points, {}});
  spec.steiner = true;
  const auto with = Reconstruct(spec, {sample.points, {}});
  ASSERT_TRUE(with && without);
  EXPECT_EQ(with->added.cols(), 0);
  EXPECT_EQ(with->simplices, without->simplices);
}

// ------------------------------------------------------------------ homology

TEST(BettiNumbers, AreThoseOfTheManifold) {
  const std::pair<SampleRequest, std::vector<std::int64_t>> kKnown[] = {
      {Of("knot", 300, true), {1, 1}},       {Of("s2", 400, true), {1, 0, 1}},
      {Of("klein", 1200, true), {1, 2, 1}},  {Of("s3", 1000, true), {1, 0, 0, 1}},
      {Of("so3", 1500, true), {1, 1, 1, 1}}, {Of("t3", 6000, true), {1, 3, 3, 1}}};
  for (const auto& [request, betti] : kKnown) {
    const Sample sample = Draw(request);
    const auto result = Reconstruct(SpecOf(sample.k, sample.d), {sample.points, {}});
    ASSERT_TRUE(result) << request.manifold;
    EXPECT_EQ(result->report.certificate.betti, betti) << request.manifold;
  }
}

}  // namespace
}  // namespace stellate::core
