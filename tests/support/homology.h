#pragma once

#include <cstdint>
#include <vector>

namespace stellate::testing {

using Facet = std::vector<std::uint32_t>;  // vertex ids of a simplex

// Betti numbers 0..k over Z/prime of the complex that the facets, of dimension k each, generate.
// GUDHI does the work, so that a mesh is judged by code that took no part in making it.
std::vector<int> BettiNumbers(const std::vector<Facet>& facets, int prime);

}  // namespace stellate::testing
