#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

namespace stellate::core {

// Work can be interrupted. It checks for that in all that it does: before each body of a
// ParallelFor, at the end of each parallel stretch, and with CheckInterruption in each loop on one
// thread that is as long as the mesh is large. What interrupted work leaves behind must not be
// used.

// Thrown out of work that was interrupted.
struct Interrupted {};

// Ends the work of another thread, once and for all.
class Interruption {
 public:
  Interruption();
  ~Interruption();
  void Raise();
  bool raised() const { return raised_; }

  struct Group;  // of oneTBB's tasks: core/base/task_group.h, for those who start them
  Group& group() { return *group_; }

 private:
  std::atomic<bool> raised_ = false;  // oneTBB forgets once a group has been waited for
  const std::unique_ptr<Group> group_;
};

// For tests: called at each check, by the thread that checks.
inline std::atomic<void (*)()> on_interruption_check = nullptr;

// Made by a task that asks often: whom to ask costs more than the answer, and is found once.
class InterruptionCheck {
 public:
  InterruptionCheck();
  bool operator()() const;

 private:
  void* const group_;
};

inline bool IsInterrupted() { return InterruptionCheck()(); }

// For long stretches of work on one thread.
void ThrowIfInterrupted();

// In a loop on one thread: checks at every 4096th step.
inline void CheckInterruption(std::size_t step) {
  if (step % 4096 == 0) ThrowIfInterrupted();
}

}  // namespace stellate::core
