#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

namespace stellate::server {

// Who is next among owners that wait for turns at something, so that those who always wait have of
// it by their weights: start-time fair queueing (Goyal, Vin and Cheng, 1996). An owner's turns are
// in the order in which they were asked for. One who did not wait has saved up nothing, and owes
// what he had. A plain state machine: no threads, no clock.
//
//   const FairQueue::Ticket ticket = queue.Ask("ada");
//   if (const auto next = queue.Next()) ...;  // it is the turn of *next, which waits no longer
//   queue.Charge("ada", seconds / weight);    // what she had
class FairQueue {
 public:
  using Ticket = std::uint64_t;  // 1, 2, ...; never used twice

  Ticket Ask(const std::string& owner);
  // Takes back what was asked; false: its turn has come.
  bool TakeBack(const std::string& owner, Ticket ticket);
  // Takes out of the queue whose turn it is: of the owner who has had least, the earliest of
  // several.
  std::optional<Ticket> Next();
  // Adds what an owner had, for his weight; less than nothing where he had less than was said.
  void Charge(const std::string& owner, double cost);

  bool empty() const { return waiting_ == 0; }
  std::size_t owners() const { return owners_.size(); }  // that wait, or had more than others

 private:
  struct Owner {
    double had = 0;  // for his weight; at least what those had who waited when he came
    std::deque<Ticket> waiting;
  };

  std::map<std::string, Owner> owners_;
  std::size_t waiting_ = 0;
  Ticket next_ticket_ = 1;
  double now_ = 0;  // what the last had, when his turn began
};

}  // namespace stellate::server
