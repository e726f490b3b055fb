#pragma once

#include <cstdint>
#include <vector>

namespace stellate::core {

// Another list of simplices takes the place of one, in a round that has added and removed some
// already: says what it does in all. All are K+1 ascending ids each; `before` is the list that
// `added` and `removed` lead to.
template <int K>
void ExchangeSimplices(const std::vector<std::uint32_t>& before,
                       const std::vector<std::uint32_t>& after, std::vector<std::uint32_t>* added,
                       std::vector<std::uint32_t>* removed);

}  // namespace stellate::core
