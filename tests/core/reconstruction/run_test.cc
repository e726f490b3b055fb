#include <gtest/gtest.h>

#include <thread>

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

TEST(Run, IsTheSameForAnyNumberOfThreads) {
  struct Case {
    SampleRequest sample;
    Weighting weights = Weighting::kAuto;
  };
  for (const Case& c : {Case{Of("torus", 1500, false, .2)}, Case{Of("so3", 800, false)},
                        Case{Of("torus", 300, false)}, Case{Of("so3", 200, true), Weighting::kOnly},
                        Case{Of("torus", 800, false), Weighting::kOnly}}) {
    const Sample sample = Draw(c.sample);
    ReconstructionSpecification spec = SpecOf(sample.k, sample.d);
    spec.weights = c.weights;
    const auto one = Reconstruct(spec, {sample.points, {}}, {.threads = 1});
    const auto eight = Reconstruct(spec, {sample.points, {}}, {.threads = 8});
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
  const auto result = Reconstruct(SpecOf(2, 3), {sample.points, {}}, {}, &watch);
  other.join();
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, StatusCode::kCancelled);
}

TEST(Run, ReportsItsProgress) {
  const Sample sample = Draw(Of("s2", 400, true));
  ReconstructionWatch watch;
  EXPECT_EQ(watch.progress().fraction, 0);
  ASSERT_TRUE(Reconstruct(SpecOf(2, 3), {sample.points, {}}, {}, &watch));
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

}  // namespace
}  // namespace stellate::core
