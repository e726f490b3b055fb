#pragma once

#include <atomic>
#include <cstddef>
#include <memory>

namespace stellate::core {

// Interruption of work by another thread. Work checks for it before each body of a ParallelFor, at
// the end of each parallel loop, and by CheckInterruption in each loop on one thread that grows
// with the mesh. The results of interrupted work must not be used.

// The exception that leaves interrupted work.
struct Interrupted {};

// Ends the work of another thread (WithThreads), for good.
class Interruption {
 public:
  Interruption();
  ~Interruption();
  void Raise();
  bool raised() const { return raised_; }

  struct Group;  // of oneTBB's tasks: core/base/task_group.h, for sources that start tasks
  Group& group() { return *group_; }

 private:
  std::atomic<bool> raised_ = false;  // oneTBB forgets once a group has been waited for
  const std::unique_ptr<Group> group_;
};

// For tests: called at each check, by the thread that checks.
inline std::atomic<void (*)()> on_interruption_check = nullptr;

// For a task that checks often: make one per task, since finding what to check costs more than the
// check.
class InterruptionCheck {
 public:
  InterruptionCheck();
  bool operator()() const;

 private:
  void* const group_;
};

inline bool IsInterrupted() { return InterruptionCheck()(); }

// Checks for interruption, in long work on one thread.
void ThrowIfInterrupted();

// Checks at every 4096th step of a loop on one thread.
inline void CheckInterruption(std::size_t step) {
  if (step % 4096 == 0) ThrowIfInterrupted();
}

}  // namespace stellate::core
