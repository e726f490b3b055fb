#pragma once

#include <cstdint>
#include <vector>

#include "core/complex/stars.h"

namespace stellate::core {

// Returns the label of the region of an arrangement that a simplex is in: that of its lowest
// vertex's star which holds it, or, if none does, the label that all its vertices have.
//
//   const int label = LabelOf<2>(stars, simplex.data());
//
//   simplex  K+1 ascending ids
//
// REQUIRES: there are labels.
template <int K>
int LabelOf(const Stars<K>& stars, const std::uint32_t* simplex);

// Returns those of simplices, K+1 ids each; empty without labels.
template <int K>
std::vector<std::int8_t> LabelsOf(const Stars<K>& stars,
                                  const std::vector<std::uint32_t>& simplices);

}  // namespace stellate::core
