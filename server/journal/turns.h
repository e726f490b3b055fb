#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>

namespace stellate::server {

// A lock that each gets in its turn: handed over in the order in which it was asked for, but first
// to those in a hurry. Whoever gives it up and asks again, over and over, holds up nobody.
class Turns {
 public:
  enum class Place { kLast, kFirst };  // in the queue; kFirst: behind others in a hurry

  void Take(Place place);
  void Give();
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
class Turn {
 public:
  Turn(Turns& turns, Turns::Place place) : turns_(turns) { turns_.Take(place); }
  ~Turn() { turns_.Give(); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  Turns& turns_;
};

}  // namespace stellate::server
