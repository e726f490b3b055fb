#include "server/turns/turns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <latch>
#include <memory>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "core/base/interruption.h"
#include "tests/support/stub_mesher.h"

namespace stellate::server::testing {
namespace {

const std::atomic<bool> kNoHurry = false;

void Await(const auto& condition) {
  while (!condition()) std::this_thread::yield();
}

TEST(Turns, NoMoreComputeThanMay) {
  Turns turns(2);
  std::atomic<int> now = 0, most = 0, done = 0;
  std::vector<std::jthread> threads;
  for (int mesh = 0; mesh < 8; ++mesh) {
    threads.emplace_back([&, owner = std::string(1, static_cast<char>('a' + mesh % 3))] {
      for (int turn = 0; turn < 200; ++turn) {
        turns.Run(owner, kNoHurry, [&] {
          const int together = ++now;
          int seen = most;
          while (together > seen && !most.compare_exchange_weak(seen, together)) continue;
          ++done;
          --now;
        });
      }
    });
  }
  threads.clear();
  EXPECT_EQ(done, 1600);
  EXPECT_LE(most, 2);
  EXPECT_EQ(turns.waiting(), 0u);
}

// Long work of one mesh does not keep another from its turn.
TEST(Turns, LongWorkGivesItsTurnAwayInTheMiddle) {
  Turns turns(1, Clock::duration::zero());
  std::atomic<bool> other_was_there = false;
  std::latch begun(1);
  std::jthread other([&] {
    begun.wait();
    turns.Run("ben", kNoHurry, [&] { other_was_there = true; });
  });
  turns.Run("ada", kNoHurry, [&] {
    begun.count_down();
    while (!other_was_there) core::ThrowIfInterrupted();
  });
  EXPECT_TRUE(other_was_there);
}

TEST(Turns, NobodyWaitsWhoIsToEnd) {
  Turns turns(1);
  std::atomic<bool> hurry = false, ran = false;
  std::jthread other;
  turns.Run("ada", kNoHurry, [&] {
    other = std::jthread([&] { turns.Run("ben", hurry, [&] { ran = true; }); });
    Await([&] { return turns.waiting() == 1; });
    hurry = true;
    turns.Hurry();
    Await([&] { return ran.load(); });
  });
  other.join();
  turns.Run("ada", kNoHurry, [&] { ran = false; });  // the turn that it did not have is not lost
  EXPECT_FALSE(ran);
}

TEST(Turns, AnExceptionGivesTheTurnBack) {
  Turns turns(1);
  EXPECT_THROW(turns.Run("ada", kNoHurry, [] { throw std::bad_alloc(); }), std::bad_alloc);
  bool ran = false;
  turns.Run("ben", kNoHurry, [&] { ran = true; });
  EXPECT_TRUE(ran);
}

// Each owner's share of the time, as the queue is told of it.
TEST(Turns, AsksForTheWeightOfWhoseTurnItIs) {
  std::vector<std::string> asked;
  Turns turns(1, std::chrono::milliseconds(1), [&](const std::string& owner) {
    asked.push_back(owner);
    return 2.0;
  });
  turns.Run("ada", kNoHurry, [] {});
  EXPECT_TRUE(std::all_of(asked.begin(), asked.end(), [](const auto& o) { return o == "ada"; }));
  EXPECT_FALSE(asked.empty());
}

class Asking final : public stellate::testing::StubMesher {
 public:
  Asking(Turns& turns, std::size_t* held)
      : StubMesher(core::Specification{}), turns_(turns), held_(held) {}
  std::shared_ptr<const core::QueryBatch> NextBatch() override { return Look(), nullptr; }
  core::Expected<core::MeshDelta> Absorb(const core::Answers&) override {
    Look();
    return core::MeshDelta{};
  }

 private:
  // Another has to wait while this one computes.
  void Look() {
    std::atomic<bool> hurry = false;
    std::jthread other([&] { turns_.Run("ben", hurry, [] {}); });
    Await([&] { return turns_.waiting() == 1; });
    ++*held_;
    hurry = true;
    turns_.Hurry();
  }
  Turns& turns_;
  std::size_t* const held_;
};

TEST(Turns, AMesherComputesInThem) {
  const auto turns = std::make_shared<Turns>(1);
  std::size_t held = 0;
  const auto mesher = InTurns(std::make_unique<Asking>(*turns, &held), turns, "ada");
  EXPECT_EQ(mesher->NextBatch(), nullptr);
  EXPECT_TRUE(mesher->Absorb({}));
  EXPECT_EQ(held, 2u);
}

}  // namespace
}  // namespace stellate::server::testing
