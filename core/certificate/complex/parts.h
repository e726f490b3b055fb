#pragma once

#include <cstddef>
#include <numeric>
#include <vector>

namespace stellate::core {

// Sets that are joined step by step.
class Parts {
 public:
  explicit Parts(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t Root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void Join(std::size_t i, std::size_t j) { parent_[Root(j)] = Root(i); }
  std::size_t Count() {
    std::size_t count = 0;
    for (std::size_t i = 0; i < parent_.size(); ++i) count += parent_[i] == i;
    return count;
  }

 private:
  std::vector<std::size_t> parent_;
};

}  // namespace stellate::core
