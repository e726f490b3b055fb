// A computation that another thread puts an end to.

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "core/base/interruption.h"
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
    while (const auto batch = mesher->NextBatch()) {
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

#if !defined(__SANITIZE_THREAD__)
// Counts the look-ups of a run on one thread, and interrupts it at one of them.
std::uint64_t look_ups, interrupt_at;
Mesher* looking_up;

void CountLookUp() {
  if (++look_ups == interrupt_at) looking_up->Interrupt();
}

class AtALookUp : public ::testing::Test {
 protected:
  ~AtALookUp() override { on_interruption_check = nullptr; }

  struct Ended {
    std::unique_ptr<Mesher> mesher;
    bool interrupted = false;
    Progress progress;              // when the last delta was handed out
    Counts counts;                  // the same
    std::uint64_t vertices = 0;     // of all deltas
    std::uint64_t looks_after = 0;  // of the interrupted round, once it was interrupted
  };

  static Ended Run(Specification spec, const testing::Answerer& answer, std::uint64_t at) {
    Ended run;
    run.mesher = NewMesher(spec, {.threads = 1});
    looking_up = run.mesher.get();
    look_ups = 0;
    interrupt_at = at;
    on_interruption_check = &CountLookUp;
    while (const auto batch = run.mesher->NextBatch()) {
      const auto delta = run.mesher->Absorb(answer(*batch));
      if (!delta) {
        EXPECT_EQ(delta.error().code, StatusCode::kCancelled);
        run.interrupted = true;
        run.looks_after = look_ups - at;
        break;
      }
      run.vertices += static_cast<std::uint64_t>(delta->points.cols());
      run.progress = run.mesher->progress();
      run.counts = run.mesher->report().counts;
    }
    on_interruption_check = nullptr;
    return run;
  }

  // At moments spread over the whole run, its first and its last included.
  static void InterruptAtMany(const Specification& spec, Oracle& oracle,
                              std::uint64_t moments = 25) {
    // Each of the few stretches of work that are within each other looks up as it ends.
    constexpr std::uint64_t kMostLooksAfter = 16;
    const auto answer = AnswererFor(oracle);
    ASSERT_FALSE(Run(spec, answer, 0).interrupted);
    const std::uint64_t all = look_ups;
    ASSERT_GT(all, 1000u);
    for (std::uint64_t moment = 0; moment < moments; ++moment) {
      const std::uint64_t at = 1 + moment * (all - 1) / (moments - 1);
      SCOPED_TRACE("at look-up " + std::to_string(at) + " of " + std::to_string(all));
      const Ended run = Run(spec, answer, at);
      ASSERT_TRUE(run.interrupted);
      EXPECT_LE(run.looks_after, kMostLooksAfter);
      const Progress& progress = run.mesher->progress();
      EXPECT_EQ(progress.round, run.progress.round);
      EXPECT_EQ(progress.vertices, run.progress.vertices);
      EXPECT_EQ(progress.simplices, run.progress.simplices);
      EXPECT_EQ(progress.queries, run.progress.queries);
      EXPECT_EQ(run.mesher->report().termination, Termination::kRunning);
      run.mesher->Cancel();
      EXPECT_EQ(run.mesher->NextBatch(), nullptr);
      const Report& report = run.mesher->report();
      EXPECT_EQ(report.termination, Termination::kCancelled);
      EXPECT_FALSE(report.certificate.certified);
      EXPECT_EQ(report.counts.vertices, run.vertices);
      EXPECT_EQ(report.counts.rounds, run.counts.rounds);
      EXPECT_EQ(report.counts.queries, run.counts.queries);
      EXPECT_EQ(report.counts.tangent_queries, run.counts.tangent_queries);
      EXPECT_EQ(report.counts.inserted_size, run.counts.inserted_size);
      EXPECT_EQ(report.counts.duplicates, run.counts.duplicates);
    }
  }
};

TEST_F(AtALookUp, OfAPlainRun) {
  const auto torus = Make("torus");
  InterruptAtMany(SpecificationFor(*torus, 0.2), *torus);
}

TEST_F(AtALookUp, OfARunWithGoodPoints) {
  const auto so3 = Make("so3");
  InterruptAtMany(SpecificationFor(*so3, 0.8), *so3, 9);
}

TEST_F(AtALookUp, OfARunThatFindsTangentsItself) {
  const auto torus = Make("torus");
  Specification spec = SpecificationFor(*torus, 0.2);
  spec.oracle.intersect_flat = spec.oracle.tangent_basis = false;
  InterruptAtMany(spec, *torus);
}

TEST_F(AtALookUp, OfASpeculation) {
  const auto torus = Make("torus");
  Specification spec = SpecificationFor(*torus, 0.2);
  spec.criteria.speculative = true;
  InterruptAtMany(spec, *torus);
}

TEST_F(AtALookUp, OfASampleThatIsAskedForAtOnce) {
  const auto torus = Make("torus");
  Specification spec = SpecificationFor(*torus, 0.06);
  spec.criteria.speculative = true;
  InterruptAtMany(spec, *torus, 15);
}

TEST_F(AtALookUp, OfARunInPartsThatIsCutShort) {
  const auto torus = Make("torus");
  Specification spec = SpecificationFor(*torus, 0.1);
  spec.limits.max_batch_queries = 20;
  spec.limits.max_rounds = 30;
  InterruptAtMany(spec, *torus);
}
#endif

}  // namespace
}  // namespace stellate::core
