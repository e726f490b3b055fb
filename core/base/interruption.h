#pragma once

#include <atomic>
#include <cstddef>

#if !defined(__SANITIZE_THREAD__)
#include <tbb/task.h>
#include <tbb/task_group.h>
#endif

namespace stellate::core {

// Work can be interrupted. It checks for that in all that it does: before each body of a
// ParallelFor, at the end of each parallel stretch, and with CheckInterruption in each loop on one
// thread that is as long as the mesh is large. What interrupted work leaves behind must not be
// used.

// Thrown out of work that was interrupted.
struct Interrupted {};

#if defined(__SANITIZE_THREAD__)
// Ends the work of another thread, once and for all.
class Interruption {
 public:
  void Raise() { raised_ = true; }
  bool raised() const { return raised_; }

 private:
  std::atomic<bool> raised_ = false;
};

inline bool IsInterrupted() { return false; }
inline void ThrowIfInterrupted() {}
class InterruptionCheck {
 public:
  bool operator()() const { return false; }
};
#else
// Ends the work of another thread, once and for all.
class Interruption {
 public:
  void Raise() {
    raised_ = true;
    context_.cancel_group_execution();
  }
  bool raised() const { return raised_; }
  tbb::task_group_context& context() { return context_; }

 private:
  std::atomic<bool> raised_ = false;  // oneTBB forgets once a group has been waited for
  tbb::task_group_context context_{tbb::task_group_context::isolated};
};

// For tests: called at each check, by the thread that checks.
inline std::atomic<void (*)()> on_interruption_check = nullptr;

// Made by a task that asks often: whom to ask costs more than the answer, and is found once.
class InterruptionCheck {
 public:
  bool operator()() const {
    if (void (*const told)() = on_interruption_check.load(std::memory_order_relaxed)) told();
    return context_ != nullptr && context_->is_group_execution_cancelled();
  }

 private:
  tbb::task_group_context* context_ = tbb::task::current_context();
};

inline bool IsInterrupted() { return InterruptionCheck()(); }

// For long stretches of work on one thread.
inline void ThrowIfInterrupted() {
  if (IsInterrupted()) throw Interrupted{};
}
#endif

// In a loop on one thread: checks at every 4096th step.
inline void CheckInterruption(std::size_t step) {
  if (step % 4096 == 0) ThrowIfInterrupted();
}

}  // namespace stellate::core
