#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <string_view>

#include "pipe/process.h"

namespace stellate::pipe {

// The process ended, or closed a pipe, before all was said.
struct Ended : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A request to stop, as something that poll wakes up for.
class StopSignal {
 public:
  explicit StopSignal(std::stop_token stop);

  int descriptor() const { return event_.get(); }  // readable once a stop was requested
  // Of what is going on: a second after the request, so that a batch that is nearly done is not
  // lost.
  std::chrono::steady_clock::time_point deadline() const { return deadline_.load(); }

 private:
  void Raise();

  Descriptor event_;
  std::atomic<std::chrono::steady_clock::time_point> deadline_;
  std::stop_callback<std::function<void()>> callback_;  // last: it may be called immediately
};

// How long a process may be silent, in seconds without a byte read or written by it.
struct Patience {
  std::chrono::duration<double> silence;  // then it has failed
  // Then, and whenever the silence has doubled, `on_waiting` is called with how long it has lasted.
  std::chrono::duration<double> unremarked;
  std::function<void(double)> on_waiting = {};
};

// Writes `question` and at the same time reads, until `take` is content with what came; `take` is
// called with process.unread whenever there is more. Nothing is left unread then.
//
// Throws Ended; std::runtime_error when the process is silent for too long, says more than it
// should or was stopped; and what `take` throws.
void Exchange(Process& process, std::string_view question,
              const std::function<bool(std::string*)>& take, const Patience& patience,
              const StopSignal& stop);

}  // namespace stellate::pipe
