#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>

namespace stellate::server {

// A mutex that threads get in the order in which they asked for it, those in a hurry first. A
// thread that unlocks and locks it again in a loop does not starve the others.
class FairMutex {
 public:
  enum class Place { kLast, kFirst };  // in the queue; kFirst: behind others in a hurry

  void Lock(Place place);
  void Unlock();
  std::size_t waiting() const;

 private:
  struct Waiter {
    std::condition_variable called;
    bool turn = false;
  };

  mutable std::mutex mutex_;
  bool taken_ = false;
  std::deque<Waiter*> hurried_, others_;
};

// Holds it while it lives.
class FairLock {
 public:
  FairLock(FairMutex& mutex, FairMutex::Place place) : mutex_(mutex) { mutex_.Lock(place); }
  ~FairLock() { mutex_.Unlock(); }
  FairLock(const FairLock&) = delete;
  FairLock& operator=(const FairLock&) = delete;

 private:
  FairMutex& mutex_;
};

}  // namespace stellate::server
