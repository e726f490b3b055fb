#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "core/base/function_ref.h"
#include "core/mesher.h"
#include "server/base/clock.h"
#include "server/turns/fair_queue.h"

namespace stellate::server {

// Who may compute: where more meshes have work than there are processors, their owners have the
// time by their weights. A turn lasts until its work is done, or for a slice where others wait:
// long work looks up now and then, and gives its turn away in the middle. Any thread.
class Turns {
 public:
  // An owner's weight, above 0; called under a lock.
  using WeightOf = std::function<double(const std::string& owner)>;

  // `most`: turns at the same time, at least 1.
  explicit Turns(
      std::size_t most, Clock::duration slice = std::chrono::milliseconds(10),
      WeightOf weight_of = [](const std::string&) { return 1.0; });

  // Before the first turn.
  void WeighBy(WeightOf weight_of) { weight_of_ = std::move(weight_of); }

  // Runs work() in a turn of that owner, on this thread, once there is one; immediately where
  // `hurry` is true, or becomes so before Hurry() is called.
  void Run(const std::string& owner, const std::atomic<bool>& hurry,
           core::FunctionRef<void()> work);
  // After a `hurry` became true: whose it is waits no longer.
  void Hurry();

  std::size_t most() const { return most_; }
  std::size_t waiting() const;

 private:
  struct Waiter {
    const std::string& owner;
    std::condition_variable called = {};
    bool has_turn = false;
  };
  class Turn;

  // Waits for a turn, having given away the one that there was, if any.
  void Take(const std::string& owner, const std::atomic<bool>& hurry, Turn* turn);
  void Give(const std::string& owner, Turn* turn);
  void GiveLocked(const std::string& owner, Turn* turn);
  void CallNextLocked();
  void ChargeLocked(const std::string& owner, Clock::duration time);

  const std::size_t most_;
  const Clock::duration slice_;
  WeightOf weight_of_;
  mutable std::mutex mutex_;
  FairQueue queue_;
  std::map<FairQueue::Ticket, Waiter*> waiters_;
  std::size_t taken_ = 0;
  std::atomic<bool> is_waited_for_ = false;  // as the queue is not empty, for who looks up
};

// The same mesher, whose rounds are computed in turns of that owner.
std::unique_ptr<core::Mesher> InTurns(std::unique_ptr<core::Mesher> mesher,
                                      std::shared_ptr<Turns> turns, std::string owner);

}  // namespace stellate::server
