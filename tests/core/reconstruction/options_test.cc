#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "core/reconstruction.h"
#include "tests/core/reconstruction/requests.h"
#include "tests/reconstruction/judge.h"
#include "tests/reconstruction/samples.h"

namespace stellate::core {
namespace {

using testing::Count;
using testing::Draw;
using testing::IsRight;
using testing::Sample;
using testing::SampleRequest;

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
  EXPECT_EQ(Reconstruct(spec, {sample.points, {}}, {.threads = 3})->simplices, result->simplices);
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

}  // namespace
}  // namespace stellate::core
