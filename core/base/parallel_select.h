#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/parallel.h"

namespace stellate::core {

// Returns those i in [0, count) that are kept, ascending: `keeps(i)` is called twice for each.
// Where many are kept it is cheaper than ParallelGather.
//
//   ParallelSelect(values.size(), [&](std::size_t i) { return values[i] < 0; });
template <typename Keeps>
std::vector<std::uint32_t> ParallelSelect(std::size_t count, const Keeps& keeps) {
  std::vector<std::size_t> ends(ChunkCount(count));
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::size_t kept = 0;
    for (std::size_t i = begin; i < end; ++i) kept += keeps(i) ? 1 : 0;
    ends[chunk] = kept;
  });
  std::size_t all = 0;
  for (std::size_t& end : ends) end = all += end;
  std::vector<std::uint32_t> selected(all);
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    std::size_t at = chunk == 0 ? 0 : ends[chunk - 1];
    for (std::size_t i = begin; i < end; ++i)
      if (keeps(i)) selected[at++] = static_cast<std::uint32_t>(i);
  });
  return selected;
}

}  // namespace stellate::core
