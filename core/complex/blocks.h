#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "core/base/parallel.h"

namespace stellate::core {

// A vector that grows without moving its items: there is never an old copy beside the new one, nor
// capacity for twice the items.
//
//   Blocks<Cell> cells;
//   cells.resize(n);  // keeps the items that it has
//   cells[0] = cell;
template <typename T>
class Blocks {
 public:
  Blocks() = default;
  Blocks(const Blocks& other) {
    resize(other.size_);
    for (std::size_t i = 0; i < size_; ++i) {
      CheckInterruption(i);
      (*this)[i] = other[i];
    }
  }
  Blocks& operator=(const Blocks&) = delete;

  std::size_t size() const { return size_; }

  // REQUIRES: size >= size(). In parallel: a thread's first touch of memory is slow.
  void resize(std::size_t size) {
    const std::size_t begin = Count(size_), end = Count(size);
    blocks_.resize(end);
    ParallelFor(end - begin,
                [&](std::size_t i) { blocks_[begin + i] = std::make_unique<T[]>(kBlock); });
    size_ = size;
  }

  T& operator[](std::size_t i) { return blocks_[i / kBlock][i % kBlock]; }
  const T& operator[](std::size_t i) const { return blocks_[i / kBlock][i % kBlock]; }

 private:
  static constexpr std::size_t kBlock = 1024;
  static std::size_t Count(std::size_t size) { return (size + kBlock - 1) / kBlock; }

  std::vector<std::unique_ptr<T[]>> blocks_;
  std::size_t size_ = 0;
};

}  // namespace stellate::core
