#pragma once

#include <algorithm>
#include <iterator>

namespace stellate::server {

// Where a mesh is between its creation and the release of its memory: always at one of these.
enum class Life {
  kMeshing,             // asks its workers; a new mesh begins here
  kReplaying,           // takes recorded answers, and will go on with its workers
  kReplayingCancelled,  // cancelled, but replays first what watchers of an earlier server have seen
  kRepeating,           // takes recorded answers to another end, which is recorded too
  kCancelled,           // must end now
  kSuspended,        // must end now, as the server stops; the next server goes on, by the journal
  kEnding,           // has its end, which is being recorded and cannot be seen yet
  kEndingCancelled,  // the same, of a mesh that is already seen as cancelled
  kEnded,            // its end can be seen; its memory is being given back
  kOver,             // nothing is left to do
};

// What may happen to a mesh, and who causes it.
enum class LifeEvent {
  kCancel,        // its owner or an administrator, on any thread
  kAbandon,       // the store, on any thread: the mesh was deleted while it ran
  kAbandonUnrun,  // the store, on any thread: the mesh was deleted and will never run
  kSuspend,       // the store, on any thread: the server stops
  kReplayed,      // Session::Run: the recorded answers are used up
  kEnd,           // Session::Run: the mesher asks no more
  kShow,          // Session::Run: the end has been recorded
  kRelease,       // Session::Run: the mesher is gone
};

struct LifeStep {
  Life from;
  LifeEvent event;
  Life to;
};

namespace life {

using enum Life;
using enum LifeEvent;

// All that may happen. An event that is not listed for a state changes nothing there.
// clang-format off
inline constexpr LifeStep kSteps[] = {
    {kMeshing,            kCancel,       kCancelled},
    {kMeshing,            kAbandon,      kCancelled},
    {kMeshing,            kSuspend,      kSuspended},
    {kMeshing,            kEnd,          kEnding},

    {kReplaying,          kCancel,       kReplayingCancelled},
    {kReplaying,          kAbandon,      kCancelled},
    {kReplaying,          kAbandonUnrun, kOver},
    {kReplaying,          kSuspend,      kSuspended},
    {kReplaying,          kReplayed,     kMeshing},
    {kReplaying,          kEnd,          kEnding},

    {kReplayingCancelled, kAbandon,      kCancelled},
    {kReplayingCancelled, kAbandonUnrun, kOver},
    {kReplayingCancelled, kSuspend,      kCancelled},
    {kReplayingCancelled, kReplayed,     kCancelled},
    {kReplayingCancelled, kEnd,          kEndingCancelled},

    {kRepeating,          kAbandon,      kCancelled},
    {kRepeating,          kAbandonUnrun, kOver},
    {kRepeating,          kSuspend,      kSuspended},
    {kRepeating,          kEnd,          kEnding},

    {kCancelled,          kAbandonUnrun, kOver},
    {kCancelled,          kEnd,          kEndingCancelled},

    {kSuspended,          kAbandonUnrun, kOver},
    {kSuspended,          kEnd,          kEndingCancelled},

    {kEnding,             kShow,         kEnded},
    {kEndingCancelled,    kShow,         kEnded},
    {kEnded,              kRelease,      kOver},
};
// clang-format on

}  // namespace life

// It takes its answers from the journal.
constexpr bool IsReplaying(Life life) {
  return life == Life::kReplaying || life == Life::kReplayingCancelled || life == Life::kRepeating;
}
// Run must end it, in the middle of a round if need be.
constexpr bool MustEnd(Life life) { return life == Life::kCancelled || life == Life::kSuspended; }
// It is over for its owner, even while its last round is being computed or replayed.
constexpr bool IsSeenAsCancelled(Life life) {
  return MustEnd(life) || life == Life::kReplayingCancelled || life == Life::kEndingCancelled;
}
// State, report and history are final.
constexpr bool HasEnded(Life life) { return life == Life::kEnded || life == Life::kOver; }

// One mesh's life. Its owner has a lock for it.
class SessionLife {
 public:
  explicit SessionLife(Life first) : now_(first) {}

  Life now() const { return now_; }

  // Takes the step that life::kSteps has for the event; false, and no step, if it has none.
  bool Step(LifeEvent event) {
    const auto* const step =
        std::find_if(std::begin(life::kSteps), std::end(life::kSteps),
                     [&](const LifeStep& s) { return s.from == now_ && s.event == event; });
    if (step == std::end(life::kSteps)) return false;
    now_ = step->to;
    return true;
  }

 private:
  Life now_;
};

}  // namespace stellate::server
