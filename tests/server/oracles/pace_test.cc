#include "server/oracles/pace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace stellate::server {
namespace {

constexpr Pace::Aim kAim{0.25, 60};

// The worker's chunks as it is asked them, its times scattered by a factor of about e^spread a
// query.
Pace After(int chunks, double fixed, double each, double spread = 0) {
  Pace pace(kAim);
  std::mt19937 random(3);
  std::lognormal_distribution<double> factor(-spread * spread / 2, spread);
  for (int i = 0; i < chunks; ++i) {
    const double n = std::floor(pace.FullChunk());
    double seconds = fixed;
    for (double q = 0; q < n && spread > 0; ++q) seconds += each * factor(random);
    if (spread == 0) seconds += each * n;
    pace.Answered({n, seconds});
  }
  return pace;
}

TEST(Pace, FindsWhatIsFixedAndWhatIsEach) {
  for (const double fixed : {0.0, 0.001, 0.02, 0.25, 2.0}) {
    for (const double each : {1e-6, 0.001, 0.1}) {
      const Pace pace = After(30, fixed, each);
      const double n = std::floor(pace.FullChunk());
      EXPECT_NEAR(pace.Seconds(n), fixed + each * n, 0.1 * (fixed + each * n));
      // Where it is a small share of a chunk it need not be known well.
      const double whole = std::max(kAim.seconds, 4 * fixed);
      EXPECT_NEAR(pace.fixed(), fixed, 0.1 * whole) << fixed << " and " << each;
    }
  }
}

TEST(Pace, WhatScattersDoesNotLookFixed) {
  for (const double each : {0.1, 2.0}) {
    const Pace pace = After(200, 0, each, 1);
    EXPECT_LE(pace.FullChunk() * each, std::max(1.0, 4 * each)) << each;
  }
}

TEST(Pace, FollowsAWorkerThatBecomesDearer) {
  Pace pace = After(40, 0, 1e-4);
  for (int i = 0; i < 20; ++i) {
    const double n = std::floor(pace.FullChunk());
    pace.Answered({n, 1e-2 * n});
  }
  EXPECT_NEAR(pace.FullChunk(), 25, 3);
}

TEST(Pace, ChunksCutShortTellLittle) {
  Pace pace = After(40, 0, 1e-4);
  const double full = pace.FullChunk();
  for (int i = 0; i < 100; ++i) pace.Answered({1, 1e-4, /*cut=*/true});
  EXPECT_EQ(pace.FullChunk(), full);
}

// A call takes long whatever it holds, now more, now less; most rounds have two queries to ask.
TEST(Pace, OneLargeChunkTellsWhatManySmallOnesDoNot) {
  for (const double spread : {0.5, 1.0, 1.5}) {
    Pace pace(kAim);
    std::mt19937 random(3);
    std::lognormal_distribution<double> factor(0, spread);
    int small = 0;
    for (int i = 0; i < 300; ++i) {
      const double full = std::floor(pace.FullChunk());
      const double n = std::min(full, i % 40 == 39 ? 2000.0 : 2.0);
      pace.Answered({n, 0.06 * factor(random) + 1e-4 * n, n < full});
      if (i > 40 && full < 100) ++small;
    }
    EXPECT_LT(small, 150) << spread;
  }
}

TEST(Pace, APauseBeforeTheFirstAnswerIsForgotten) {
  Pace pace(kAim);
  pace.Answered({1, 5});  // it was started, or compiled, or licensed
  for (int i = 0; i < 20; ++i) {
    const double n = std::floor(pace.FullChunk());
    pace.Answered({n, 1e-4 * n});
  }
  EXPECT_NEAR(pace.FullChunk(), 2500, 250);
}

TEST(Pace, AnAnswerThatTravelledBesideAnotherDoesNotSeemFree) {
  Pace pace(kAim);
  for (int i = 0; i < 300; ++i) {
    const double n = std::floor(pace.FullChunk());
    if (i >= 8) {  // free would be 600,000, and all of it the queries' would be 1
      EXPECT_GE(n, 1000) << i;
      EXPECT_LE(n, 20000) << i;
    }
    const double first = 0.5 + 1e-4 * n;
    pace.Answered({n, first});
    pace.Answered({n, 1e-4 * n, /*cut=*/false, /*behind=*/first});
  }
}

// Its next chunk is always there when an answer comes, so each but the first waits behind another.
TEST(Pace, ChunksGrowThoughTheyQueueUp) {
  for (const double fixed : {0.0, 0.02, 0.2}) {
    for (const double each : {1e-6, 1e-4, 1e-2}) {
      Pace pace(kAim);
      double behind = 0;
      for (int i = 0; i < 40; ++i) {
        const double n = std::floor(pace.FullChunk());
        const double seconds = fixed + each * n;
        pace.Answered({n, seconds, /*cut=*/false, behind});
        behind = seconds;
      }
      const double whole = std::max(kAim.seconds, 4 * fixed);
      EXPECT_GT(pace.FullChunk(), 0.7 * (whole - fixed) / each) << fixed << " and " << each;
      EXPECT_LT(pace.FullChunk(), 1.2 * whole / each) << fixed << " and " << each;
    }
  }
}

TEST(Pace, NeverMoreThanMayTakeItsTime) {
  for (const double each : {1.0, 9.0, 40.0, 59.0}) {
    Pace pace(kAim);
    for (int i = 0; i < 50; ++i) {
      const double n = std::floor(pace.FullChunk());
      EXPECT_LE(n * each, kAim.limit);
      pace.Answered({n, each * n});
    }
  }
}

TEST(Pace, NonsenseIsBounded) {
  Pace pace(kAim);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> exponent(-12, 6);
  for (int i = 0; i < 2000; ++i) {
    const double n = std::floor(std::min(pace.FullChunk(), 1e9));
    pace.Answered({n, random() % 10 == 0 ? 0.0 : std::pow(10, exponent(random)), random() % 3 == 0,
                   random() % 2 == 0 ? std::pow(10, exponent(random)) : 0.0});
    ASSERT_GE(pace.FullChunk(), 1);
    ASSERT_TRUE(std::isfinite(pace.FullChunk()));
    ASSERT_TRUE(std::isfinite(pace.Seconds(n)));
    ASSERT_GE(pace.Seconds(n), 0);
  }
}

}  // namespace
}  // namespace stellate::server
