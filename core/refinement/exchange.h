#pragma once

#include <cstdint>
#include <vector>

namespace stellate::core {

// Composes a round's change with the replacement of `before` by `after`. `added` and `removed` come
// in as the change that led to `before`, and go out as the change that leads to `after`. All are
// K+1 ascending ids each.
template <int K>
void ExchangeSimplices(const std::vector<std::uint32_t>& before,
                       const std::vector<std::uint32_t>& after, std::vector<std::uint32_t>* added,
                       std::vector<std::uint32_t>* removed);

}  // namespace stellate::core
