#pragma once

#include <functional>
#include <mutex>
#include <utility>
#include <vector>

namespace stellate::server {

// Something that happens once, and the calls that wait for it. Any thread.
//
//   occasion.Then([call] { call->Answer(); });  // immediately, if it has happened
//   occasion.Happen();                           // calls all that wait, once each
class Occasion {
 public:
  bool HasHappened() const {
    const std::lock_guard lock(mutex_);
    return has_happened_;
  }

  // `call` comes on this thread or on the one that Happen is called on, and takes its own locks.
  void Then(std::function<void()> call) {
    {
      const std::lock_guard lock(mutex_);
      if (!has_happened_) return waiting_.push_back(std::move(call));
    }
    call();
  }

  // Again has no effect.
  void Happen() {
    std::vector<std::function<void()>> waiting;
    {
      const std::lock_guard lock(mutex_);
      has_happened_ = true;
      waiting.swap(waiting_);
    }
    for (const auto& call : waiting) call();
  }

 private:
  mutable std::mutex mutex_;
  bool has_happened_ = false;
  std::vector<std::function<void()>> waiting_;
};

}  // namespace stellate::server
