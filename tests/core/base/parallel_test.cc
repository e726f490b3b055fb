#include "core/base/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/base/arenas.h"
#include "core/base/parallel_sort.h"
#include "core/base/pauses.h"
#include "core/base/random.h"

namespace stellate::core {
namespace {

int Sum(int threads) {
  Interruption interruption;
  std::atomic<int> sum = 0;
  EXPECT_TRUE(
      WithThreads(threads, interruption, [&] { ParallelFor(100, [&](int i) { sum += i; }); }));
  return sum;
}

TEST(Parallel, EveryIndexIsCalledOnce) {
  for (const int threads : {0, 1, 2}) EXPECT_EQ(Sum(threads), 4950);
}

// Fewer than a block, whole blocks, one item beyond, pairs that do not come out even.
TEST(Parallel, SortsAnyNumberOfItems) {
  for (const std::size_t count : {0u, 1u, 1023u, 1024u, 1025u, 3'000u, 5'121u, 100'003u}) {
    std::vector<std::uint64_t> items(count);
    for (std::size_t i = 0; i < count; ++i) items[i] = Mix64(i);
    std::vector<std::uint64_t> expected = items;
    std::sort(expected.begin(), expected.end(), std::greater<>());
    ParallelSort(items, std::greater<>());
    EXPECT_EQ(items, expected) << count;
  }
}

#if !defined(__SANITIZE_THREAD__)
TEST(Parallel, InterruptedWorkIsNotBegun) {
  Interruption interruption;
  interruption.Raise();
  bool begun = false;
  EXPECT_FALSE(WithThreads(0, interruption, [&] { begun = true; }));
  EXPECT_FALSE(begun);
}

TEST(Parallel, WorkEndsWhereItIsInterrupted) {
  Interruption interruption;
  bool after = false;
  EXPECT_FALSE(WithThreads(0, interruption, [&] {
    ParallelFor(100, [&](int) { interruption.Raise(); });
    after = true;
  }));
  EXPECT_FALSE(after);
}

// However many bodies oneTBB takes for one task.
TEST(Parallel, NoBodyBeginsOnceInterrupted) {
  Interruption interruption;
  int begun = 0;
  EXPECT_FALSE(WithThreads(1, interruption, [&] {
    ParallelFor(100'000, [&](int) {
      ++begun;
      interruption.Raise();
    });
  }));
  EXPECT_EQ(begun, 1);
}

TEST(Parallel, ALongLoopLooksUpNowAndThen) {
  Interruption interruption;
  std::size_t step = 0;
  EXPECT_FALSE(WithThreads(1, interruption, [&] {
    for (;; ++step) {
      CheckInterruption(step);
      if (step == 5000) interruption.Raise();
    }
  }));
  EXPECT_EQ(step, 8192u);
}

TEST(Parallel, ChecksPauseTheThreadThatAsksForIt) {
  Interruption interruption;
  int pauses = 0;
  const auto pause = [&pauses] { ++pauses; };
  {
    const Pauses asked(pause);
    EXPECT_TRUE(WithThreads(1, interruption, [] { ParallelFor(1000, [](int) {}); }));
    EXPECT_GE(pauses, 1000);
    std::thread other([] { ThrowIfInterrupted(); });
    const int before = pauses;
    other.join();
    EXPECT_EQ(pauses, before);
  }
  const int before = pauses;
  ThrowIfInterrupted();
  EXPECT_EQ(pauses, before);
}

// One given up would stay in memory for as long as others have work.
TEST(Parallel, ArenasAreUsedAgain) {
  constexpr int kAtOnce = 3;
  const std::size_t before = ArenaCount();
  std::barrier together(kAtOnce);
  std::vector<std::thread> threads;
  for (int t = 0; t < kAtOnce; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < 50; ++i) {
        EXPECT_EQ(Sum(0), 4950);
        EXPECT_EQ(Sum(1), 4950);
        together.arrive_and_wait();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(ArenaCount(), before + 2 * kAtOnce);
}

TEST(Parallel, AnArenaComesBackFromWorkThatThrows) {
  Sum(2);
  const std::size_t before = ArenaCount();
  Interruption interruption;
  for (int i = 0; i < 10; ++i) {
    EXPECT_THROW(WithThreads(2, interruption, [] { throw std::runtime_error("full"); }),
                 std::runtime_error);
  }
  EXPECT_EQ(ArenaCount(), before);
}
#endif

}  // namespace
}  // namespace stellate::core
