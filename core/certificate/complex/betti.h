#pragma once

#include <cstdint>
#include <vector>

namespace stellate::core {

// Returns the Betti numbers over Z/2, from dimension 0 on, of a complex of dimension 2 or less that
// has no facet in more than two simplices; empty, if it is another: they are not computed.
//
// components, euler_characteristic  of the complex
// simplices                         dimension + 1 ascending ids each
std::vector<std::int64_t> BettiNumbers(int dimension, std::int64_t components,
                                       std::int64_t euler_characteristic,
                                       const std::vector<std::uint32_t>& simplices);

}  // namespace stellate::core
