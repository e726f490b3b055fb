#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

namespace stellate::core {

// Numbers the few different ids of a star in the order in which they come: 0, 1, 2... A hash table
// for repeated use. Any id is allowed except kNone.
//
//   index.Clear(star.size());
//   index.Number(17);  // 0
//   index.Number(4);   // 1
//   index.Number(17);  // 0
class SmallIndex {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  // Forgets all ids. `expected` ids fit without growing.
  void Clear(std::size_t expected) {
    slots_.assign(std::bit_ceil(2 * expected + 2), {});
    shift_ = 32 - std::countr_zero(slots_.size());
    size_ = 0;
  }

  // Returns the number of different ids so far.
  std::uint32_t size() const { return size_; }

  // Returns the id's number; the next one, size(), for an id not seen before.
  [[gnu::always_inline]] std::uint32_t Number(std::uint32_t id) {
    if (2 * std::size_t{size_} >= slots_.size()) Grow();
    Slot& slot = SlotOf(id);
    if (slot.id == kNone) slot = {id, size_++};
    return slot.number;
  }

 private:
  struct Slot {
    std::uint32_t id = kNone, number = 0;
  };

  Slot& SlotOf(std::uint32_t id) {
    const std::size_t last = slots_.size() - 1;
    std::size_t at = (id * 0x9e3779b9u) >> shift_;
    while (slots_[at].id != id && slots_[at].id != kNone) at = (at + 1) & last;
    return slots_[at];
  }

  void Grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    --shift_;
    for (const Slot& slot : old)
      if (slot.id != kNone) SlotOf(slot.id) = slot;
  }

  std::vector<Slot> slots_;  // a power of two, half of them empty at least
  int shift_ = 0;
  std::uint32_t size_ = 0;
};

}  // namespace stellate::core
