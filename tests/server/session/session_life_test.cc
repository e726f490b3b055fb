#include "server/session/session_life.h"

#include <gtest/gtest.h>

#include <optional>
#include <set>
#include <vector>

namespace stellate::server {
namespace {

std::vector<Life> AllStates() {
  std::vector<Life> all;
  for (int i = 0; i <= static_cast<int>(Life::kOver); ++i) all.push_back(static_cast<Life>(i));
  return all;
}

std::vector<LifeEvent> AllEvents() {
  std::vector<LifeEvent> all;
  for (int i = 0; i <= static_cast<int>(LifeEvent::kRelease); ++i)
    all.push_back(static_cast<LifeEvent>(i));
  return all;
}

// Where the event leads; nothing: it is refused.
std::optional<Life> After(Life from, LifeEvent event) {
  SessionLife life(from);
  const bool stepped = life.Step(event);
  EXPECT_EQ(stepped, life.now() != from) << "a refused event changes nothing";
  return stepped ? std::optional(life.now()) : std::nullopt;
}

TEST(SessionLife, TakesTheStepsOfItsTableAndNoOther) {
  std::size_t taken = 0;
  for (const Life from : AllStates()) {
    for (const LifeEvent event : AllEvents()) {
      std::optional<Life> listed;
      for (const LifeStep& step : life::kSteps) {
        if (step.from != from || step.event != event) continue;
        EXPECT_FALSE(listed) << "listed twice";
        listed = step.to;
      }
      EXPECT_EQ(After(from, event), listed)
          << "from " << static_cast<int>(from) << " by " << static_cast<int>(event);
      if (listed) ++taken;
    }
  }
  EXPECT_EQ(taken, std::size(life::kSteps));
}

TEST(SessionLife, ReachesItsEndFromEverywhereAndNeverComesBack) {
  for (const Life from : AllStates()) {
    std::set<Life> later, fresh{from};
    while (!fresh.empty()) {
      std::set<Life> next;
      for (const Life state : fresh) {
        for (const LifeEvent event : AllEvents()) {
          const auto to = After(state, event);
          if (to && later.insert(*to).second) next.insert(*to);
        }
      }
      fresh = next;
    }
    EXPECT_FALSE(later.contains(from)) << static_cast<int>(from);
    EXPECT_EQ(later.contains(Life::kOver), from != Life::kOver) << static_cast<int>(from);
  }
}

// The session's thread alone takes a mesh from its last round to its release, whatever came before.
TEST(SessionLife, RunCanAlwaysEndTheMesh) {
  for (const Life from : AllStates()) {
    if (HasEnded(from) || from == Life::kEnding || from == Life::kEndingCancelled) continue;
    SessionLife life(from);
    EXPECT_TRUE(life.Step(LifeEvent::kEnd));
    EXPECT_FALSE(HasEnded(life.now())) << "it is recorded first";
    EXPECT_TRUE(life.Step(LifeEvent::kShow));
    EXPECT_TRUE(HasEnded(life.now()));
    EXPECT_TRUE(life.Step(LifeEvent::kRelease));
    EXPECT_EQ(life.now(), Life::kOver);
  }
}

TEST(SessionLife, NothingFromOutsideChangesAnEndThatIsChosen) {
  for (const Life state : {Life::kEnding, Life::kEndingCancelled, Life::kEnded, Life::kOver}) {
    for (const LifeEvent event :
         {LifeEvent::kCancel, LifeEvent::kAbandon, LifeEvent::kAbandonUnrun, LifeEvent::kSuspend}) {
      EXPECT_FALSE(After(state, event)) << static_cast<int>(state);
    }
  }
}

TEST(SessionLife, ACancelledMeshIsSeenAsSuchUntilItsEndIs) {
  for (const LifeStep& step : life::kSteps) {
    if (!IsSeenAsCancelled(step.from)) continue;
    EXPECT_TRUE(IsSeenAsCancelled(step.to) || HasEnded(step.to)) << static_cast<int>(step.from);
    EXPECT_FALSE(After(step.from, LifeEvent::kCancel)) << static_cast<int>(step.from);
  }
}

TEST(SessionLife, WhatWatchersHaveSeenIsReplayedBeforeACancelledMeshEnds) {
  EXPECT_EQ(After(Life::kReplaying, LifeEvent::kCancel), Life::kReplayingCancelled);
  EXPECT_TRUE(IsReplaying(Life::kReplayingCancelled));
  EXPECT_FALSE(MustEnd(Life::kReplayingCancelled));
  EXPECT_FALSE(After(Life::kRepeating, LifeEvent::kCancel)) << "it had ended";
}

TEST(SessionLife, ADeletedMeshAndAServerThatStopsBreakOffWhateverGoesOn) {
  for (const Life from : AllStates()) {
    for (const LifeEvent event : {LifeEvent::kAbandon, LifeEvent::kSuspend}) {
      const auto to = After(from, event);
      EXPECT_TRUE(!to || MustEnd(*to)) << static_cast<int>(from);
    }
    if (from == Life::kMeshing || IsReplaying(from)) {
      EXPECT_TRUE(After(from, LifeEvent::kAbandon)) << static_cast<int>(from);
      EXPECT_TRUE(After(from, LifeEvent::kSuspend)) << static_cast<int>(from);
    }
  }
}

}  // namespace
}  // namespace stellate::server
