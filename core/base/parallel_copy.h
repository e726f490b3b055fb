#pragma once

#include <algorithm>
#include <cstddef>

#include "core/base/parallel.h"

namespace stellate::core {

// Copies `count` numbers, in parallel if there are many. The two arrays must not overlap.
//
//   ParallelCopy(values.data(), values.size(), norms.data());
template <typename Number>
void ParallelCopy(const Number* from, std::size_t count, Number* to) {
  constexpr std::size_t kFew = 4096;
  const auto copy = [&](std::size_t begin, std::size_t end) {
    std::copy(from + begin, from + end, to + begin);
  };
  if (count < kFew)
    copy(0, count);
  else
    ParallelRanges(count, copy);
}

}  // namespace stellate::core
