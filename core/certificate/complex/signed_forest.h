#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>

#include "core/base/parallel.h"

namespace stellate::core {

// A union-find forest of things that have two orientations each (stars, simplices), joined by ties
// that say whether two of them are oriented oppositely. Any number of threads may tie concurrently:
// the trees in the end, and whether some tie contradicts others, do not depend on the order. Takes
// 8 bytes for each.
//
//   SignedForest forest(count);
//   if (!forest.Join(a, b, true)) ...;               // contradicts what was said before
//   const auto [root, flips] = forest.Climb(a);      // the least number in the tree of a
class SignedForest {
 public:
  explicit SignedForest(std::uint32_t size)
      : size_(size), up_(std::make_unique<std::atomic<Up>[]>(size)) {
    ParallelFor(size, [&](std::uint32_t v) { up_[v].store(Pack(v, 0), kRelaxed); });
  }

  // Returns false if this tie contradicts others.
  bool Join(std::uint32_t a, std::uint32_t b, bool flips) {
    const Up differ = flips ? 1 : 0;
    const Up up_a = up_[a].load(kRelaxed), up_b = up_[b].load(kRelaxed);
    if (Parent(up_a) == Parent(up_b)) return (Flips(up_a) ^ Flips(up_b)) == differ;  // as mostly
    while (true) {
      const auto [root_a, flips_a] = Climb(a);
      const auto [root_b, flips_b] = Climb(b);
      const Up of_roots = flips_a ^ flips_b ^ differ;
      if (root_a == root_b) return of_roots == 0;
      const std::uint32_t low = std::min(root_a, root_b), high = std::max(root_a, root_b);
      Up root = Pack(high, 0);
      if (up_[high].compare_exchange_strong(root, Pack(low, of_roots), kRelaxed)) return true;
      // Another thread has tied that root meanwhile.
    }
  }

  std::uint64_t CountTrees() const {
    std::uint64_t trees = 0;
    for (std::uint32_t v = 0; v < size_; ++v) trees += Parent(up_[v].load(kRelaxed)) == v;
    return trees;
  }

  // Returns the root, and whether v is oriented oppositely to it: 1 or 0. Halves the path there.
  std::pair<std::uint32_t, std::uint64_t> Climb(std::uint32_t v) {
    Up flips = 0;
    while (true) {
      Up up = up_[v].load(kRelaxed);
      const std::uint32_t parent = Parent(up);
      if (parent == v) return {v, flips};
      const Up above = up_[parent].load(kRelaxed);
      const Up both = Flips(up) ^ Flips(above);
      if (Parent(above) != parent)
        up_[v].compare_exchange_weak(up, Pack(Parent(above), both), kRelaxed);
      flips ^= both;
      v = Parent(above);
    }
  }

 private:
  // The parent (a root is its own), and in the lowest bit whether the two are oriented oppositely:
  // one word, so that no thread reads half of it. Threads share nothing else.
  using Up = std::uint64_t;
  static constexpr auto kRelaxed = std::memory_order_relaxed;
  static Up Pack(std::uint32_t parent, Up flips) { return Up{parent} << 1 | flips; }
  static std::uint32_t Parent(Up up) { return static_cast<std::uint32_t>(up >> 1); }
  static Up Flips(Up up) { return up & 1; }

  std::uint32_t size_;
  std::unique_ptr<std::atomic<Up>[]> up_;
};

}  // namespace stellate::core
