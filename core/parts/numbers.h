#pragma once

#include <compare>
#include <cstdint>
#include <span>
#include <vector>

#include "core/peers.h"

namespace stellate::core {

// What things of many parts are put in order by: the first number tells parts that share them.
struct OrderKey {
  std::uint32_t patch;
  std::uint64_t name;
  std::uint32_t first;
  auto operator<=>(const OrderKey&) const = default;
};

// Returns the number of each key in the order of all parts' keys, from 0. No two are the same.
// `patches`: all keys' are less.
std::vector<std::uint32_t> NumbersOf(const Peers& peers, std::span<const OrderKey> keys,
                                     std::uint32_t patches);

}  // namespace stellate::core
