#pragma once

#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace stellate::core {

// The allocator of UnsetVector.
template <typename Item>
struct UnsetAllocator : std::allocator<Item> {
  template <typename Other>
  void construct(Other* at) noexcept {
    ::new (static_cast<void*>(at)) Other;
  }
  template <typename Other, typename... From>
  void construct(Other* at, From&&... from) {
    ::new (static_cast<void*>(at)) Other(std::forward<From>(from)...);
  }
};

// A vector of numbers whose new ones are not set to zero: for large arrays that a parallel loop
// writes anyway. It grows number by number, slower than others: resize it once.
template <typename Number>
using UnsetVector = std::vector<Number, UnsetAllocator<Number>>;

}  // namespace stellate::core
