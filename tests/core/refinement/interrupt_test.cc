// A computation that another thread puts an end to.

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tests/core/support/in_process_run.h"

namespace stellate::core {
namespace {

using testing::AnswererFor;
using testing::Make;
using testing::NewMesher;
using testing::SpecificationFor;

TEST(Interrupt, EndsWhatFollows) {
  const auto torus = Make("torus");
  const auto mesher = NewMesher(SpecificationFor(*torus, 0.1));
  const auto answer = AnswererFor(*torus);
  std::uint64_t vertices = 0;
  for (int round = 0; round < 5; ++round) {
    const auto delta = mesher->Absorb(answer(*mesher->NextBatch()));
    ASSERT_TRUE(delta);
    vertices += static_cast<std::uint64_t>(delta->points.cols());
  }
  mesher->Interrupt();
  const auto delta = mesher->Absorb(answer(*mesher->NextBatch()));
  ASSERT_FALSE(delta);
  EXPECT_EQ(delta.error().code, StatusCode::kCancelled);
  mesher->Cancel();
  EXPECT_EQ(mesher->NextBatch(), nullptr);
  EXPECT_EQ(mesher->report().termination, Termination::kCancelled);
  EXPECT_EQ(mesher->report().counts.vertices, vertices) << "what was handed out, no more";
  EXPECT_EQ(mesher->report().counts.rounds, 5u);
}

// At any moment of a run, be it in the middle of a round.
TEST(Interrupt, ComesFromAnyThreadAtAnyTime) {
  const auto so3 = Make("so3");
  for (const std::uint64_t at : {1, 3, 6, 9, 12, 15}) {
    const auto mesher = NewMesher(SpecificationFor(*so3, 0.5));
    const auto answer = AnswererFor(*so3);
    std::atomic<std::uint64_t> round{0};
    std::thread other([&] {
      while (round < at) std::this_thread::yield();
      mesher->Interrupt();
    });
    StatusCode last = StatusCode::kOk;
    std::uint64_t vertices = 0;
    while (const QueryBatch* batch = mesher->NextBatch()) {
      const Answers answers = answer(*batch);
      ++round;
      if (const auto delta = mesher->Absorb(answers)) {
        vertices += static_cast<std::uint64_t>(delta->points.cols());
      } else {
        last = delta.error().code;
        mesher->Cancel();
      }
    }
    round = at;
    other.join();
    EXPECT_EQ(mesher->report().counts.vertices, vertices);
    // It may have come too late.
    if (last == StatusCode::kOk) {
      EXPECT_EQ(mesher->report().termination, Termination::kConverged);
    } else {
      EXPECT_EQ(last, StatusCode::kCancelled);
      EXPECT_EQ(mesher->report().termination, Termination::kCancelled);
    }
  }
}

}  // namespace
}  // namespace stellate::core
