#include "tests/reconstruction/samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/reconstruction.h"
#include "tests/core/reconstruction/requests.h"
#include "tests/reconstruction/judge.h"

namespace stellate::core {
namespace {

using testing::Count;
using testing::Draw;
using testing::IsRight;
using testing::Sample;
using testing::SampleRequest;

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

// What a verdict makes of the dimension that such points seem to have.
TEST(Refusal, OfFewOrNoisyPointsDoesNotInsistOnAnotherDimension) {
  const auto verdict = [](const SampleRequest& request) {
    const Sample sample = Draw(request);
    return Reconstruct(SpecOf(sample.k, sample.d), {sample.points, {}})->report.certificate.verdict;
  };
  const std::string few = verdict(Of("torus", 70, true));
  EXPECT_NE(few.find("look 3-dimensional"), std::string::npos) << few;
  EXPECT_NE(few.find("or more points, if these are too few"), std::string::npos) << few;
  const std::string noisy = verdict(Of("torus", 1500, false, 1));
  EXPECT_NE(noisy.find("look 3-dimensional"), std::string::npos) << noisy;
  EXPECT_NE(noisy.find("or less noise"), std::string::npos) << noisy;
}

// A closed curve of the right topology, so noisy that most places look 2-dimensional: the verdict
// says that, and which places say NOISE.
TEST(Refusal, OfARightCurveSaysTheDimensionAndThePlaces) {
  const Sample sample = Draw(Of("circle", 200, false, 1));
  const auto result = Reconstruct(SpecOf(1, 2), {sample.points, {}});
  ASSERT_TRUE(result) << result.error().message;
  const Certificate& certificate = result->report.certificate;
  EXPECT_EQ(certificate.level, CertificateLevel::kDecided);
  EXPECT_NE(certificate.verdict.find("they look 2-dimensional"), std::string::npos)
      << certificate.verdict;
  EXPECT_NE(certificate.verdict.find("As it is, something is wrong at "), std::string::npos)
      << certificate.verdict;
  EXPECT_NE(certificate.verdict.find("NOISE"), std::string::npos) << certificate.verdict;
}

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
                      // So few that noise and bends look alike.
                      With(Of("torus", 70, false), 2, {Place::kSparse}),
                      With(Of("torus", 70, true), 2, {Place::kSparse}),
                      With(Of("knot", 30, false), 1, {Place::kSparse}),
                      With(Of("t3", 2000, false), 3, {Place::kSparse}),
                      With(Of("torus", 1500, false, .8), 2, {Place::kNoise}),
                      With(Of("shells", 1500, false), 2, {Place::kSheets, Place::kNoise}, .5),
                      With(Of("half", 1000, true), 2, {Place::kEdge}),
                      With(Of("torus", 3000, false), 2, {Place::kEdge}, 0, 6),
                      With(Of("torus", 1500, false), 2, {Place::kNoise, Place::kSheets}, 0, 0, .1),
                      With(Of("torus", 1500, false), 2, {Place::kNoise}, 0, 0, .01),
                      With(Of("torus", 1000, false), 1, {Place::kNoise, Place::kSparse}),
                      With(Of("knot", 400, false), 2, {Place::kEdge}),
                      With(Of("klein", 1000, false), 3, {Place::kEdge})));

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
