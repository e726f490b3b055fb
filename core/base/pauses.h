#pragma once

#include "core/base/function_ref.h"

namespace stellate::core {

// While it lives, each check for interruption on this thread (core/base/interruption.h) calls
// `pause`, which may take its time: so that the long work of one mesh lets others have the
// processor. Other threads of the work go on. `pause` must outlive it; what it throws leaves the
// work.
//
//   const Pauses pauses([&] { if (SliceIsOver()) WaitForTurn(); });
//   WithThreads(4, interruption, [&] { Refine(); });
class Pauses {
 public:
  explicit Pauses(FunctionRef<void()> pause);
  ~Pauses();
  Pauses(const Pauses&) = delete;
  Pauses& operator=(const Pauses&) = delete;

 private:
  friend void PauseIfAsked();

  const FunctionRef<void()> pause_;
  const Pauses* const outer_;
};

// For checks alone.
void PauseIfAsked();

}  // namespace stellate::core
