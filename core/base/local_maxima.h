#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/base/parallel.h"

namespace stellate::core {

// Makes the greedy choice among things in conflict: each is chosen unless a stronger one in
// conflict with it is. Works in parallel passes; a pass decides everything that waits for no
// undecided stronger thing. The choice is the same for any number of threads. Call
// ChooseLocalMaxima.
//
// visit_stronger(i, visit) calls visit(j) for each stronger conflict j of i, until that returns
// false; "stronger" is a strict order.
template <typename VisitStronger>
class LocalMaxima {
 public:
  // elsewhere: by thing, whether it is decided elsewhere (see Take). Empty: none is.
  LocalMaxima(std::size_t count, const VisitStronger& visit_stronger,
              std::vector<std::uint8_t> elsewhere = {})
      : count_(count),
        visit_stronger_(visit_stronger),
        state_(std::make_unique<std::atomic<State>[]>(count)),
        elsewhere_(std::move(elsewhere)) {}

  // Decides what waits for nothing that is still to be taken, or much of it. Returns how many are
  // left, of those decided here: none if all are.
  std::size_t DecideOwn() {
    if (!has_begun_)
      open_ = LeftOpen(count_, [](std::size_t i) { return i; });
    else
      open_ = LeftOpen(open_.size(), [&](std::size_t at) { return open_[at]; });
    has_begun_ = true;
    for (int pass = 1; pass < kMostPasses && !open_.empty(); ++pass) {
      const std::size_t before = open_.size();
      open_ = LeftOpen(before, [&](std::size_t at) { return open_[at]; });
      if (open_.size() == before) return before;  // all of them wait for others
    }
    if (!elsewhere_.empty()) return open_.size();
    for (std::size_t at = 0; at < open_.size(); ++at) {
      CheckInterruption(at);
      Follow(open_[at]);
    }
    open_.clear();
    return 0;
  }

  // What was decided elsewhere.
  void Take(std::size_t i, bool is_chosen) { Set(i, is_chosen ? kChosen : kRefused); }
  bool IsOpen(std::size_t i) const { return Get(i) == kOpen; }
  bool IsChosen(std::size_t i) const { return Get(i) == kChosen; }

  std::vector<std::uint8_t> Chosen() const {
    std::vector<std::uint8_t> chosen(count_);
    ParallelRanges(count_, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) chosen[i] = Get(i) == kChosen;
    });
    return chosen;
  }

 private:
  enum State : std::uint8_t { kOpen, kRefused, kChosen };
  // Passes are few where strengths are as good as random; long chains are followed one by one.
  static constexpr int kMostPasses = 32;

  // It does not matter whether decisions of other threads are seen meanwhile: the choice is the
  // same.
  State Get(std::size_t i) const { return state_[i].load(std::memory_order_relaxed); }
  void Set(std::size_t i, State state) { state_[i].store(state, std::memory_order_relaxed); }

  // Decides i, or leaves it open and returns what it waits for.
  bool Decide(std::size_t i, std::size_t* held_up_by) {
    State now = kChosen;
    visit_stronger_(i, [&](std::size_t j) {
      const State other = Get(j);
      if (other == kRefused) return true;
      now = other == kChosen ? kRefused : kOpen;
      *held_up_by = j;
      return now == kOpen;
    });
    if (now != kOpen) Set(i, now);
    return now != kOpen;
  }

  template <typename At>
  std::vector<std::size_t> LeftOpen(std::size_t count, const At& at) {
    return ParallelGather<std::size_t>(count, [&](std::size_t i, std::vector<std::size_t>* left) {
      std::size_t held_up_by = 0;
      const std::size_t thing = at(i);
      if (!IsElsewhere(thing) && !Decide(thing, &held_up_by)) left->push_back(thing);
    });
  }

  bool IsElsewhere(std::size_t i) const { return !elsewhere_.empty() && elsewhere_[i] != 0; }

  void Follow(std::size_t i) {
    std::vector<std::size_t> waiting = {i};
    while (!waiting.empty()) {
      std::size_t held_up_by = 0;
      if (!IsOpen(waiting.back()) || Decide(waiting.back(), &held_up_by))
        waiting.pop_back();
      else
        waiting.push_back(held_up_by);
    }
  }

  std::size_t count_;
  const VisitStronger& visit_stronger_;
  std::unique_ptr<std::atomic<State>[]> state_;
  const std::vector<std::uint8_t> elsewhere_;
  std::vector<std::size_t> open_;  // once it has begun
  bool has_begun_ = false;
};

// Returns 1 for each thing that is chosen, else 0.
template <typename VisitStronger>
std::vector<std::uint8_t> ChooseLocalMaxima(std::size_t count,
                                            const VisitStronger& visit_stronger) {
  LocalMaxima<VisitStronger> choice(count, visit_stronger);
  choice.DecideOwn();
  return choice.Chosen();
}

}  // namespace stellate::core
