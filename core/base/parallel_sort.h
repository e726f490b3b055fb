#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/base/parallel.h"

namespace stellate::core {

// Sorts items in place, in parallel if there are more than a thousand. `less` is a strict total
// order: equal items would end up in any order.
//
//   ParallelSort(values, std::less<>());
//
// Blocks are sorted, and
// merged in pairs: oneTBB's parallel_sort makes two loops of its own for each kind of item, several
// times the code.
template <typename Item, typename Less>
void ParallelSort(std::vector<Item>& items, const Less& less) {
  constexpr std::size_t kLeastBlock = 1024, kBlocks = 16;
  const std::size_t count = items.size();
  const auto at = [count](std::vector<Item>& of, std::size_t i) {
    return of.begin() + static_cast<std::ptrdiff_t>(std::min(i, count));
  };
  std::size_t block = std::max(kLeastBlock, (count + kBlocks - 1) / kBlocks);
  ParallelFor((count + block - 1) / block, [&](std::size_t b) {
    std::sort(at(items, b * block), at(items, (b + 1) * block), less);
  });
  std::vector<Item> merged(block < count ? count : 0);
  for (; block < count; block *= 2) {
    const std::size_t pair = 2 * block;
    ParallelFor((count + pair - 1) / pair, [&](std::size_t p) {
      const auto middle = at(items, p * pair + block);
      std::merge(at(items, p * pair), middle, middle, at(items, (p + 1) * pair),
                 at(merged, p * pair), less);
    });
    items.swap(merged);
  }
}

}  // namespace stellate::core
