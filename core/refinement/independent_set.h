#pragma once

#include <cstdint>
#include <vector>

#include "core/complex/star_complex.h"
#include "core/refinement/target.h"

namespace stellate::core {

// The targets of one round: a maximal set in which no insertion point lies in the conflict ball of
// another (radius |x| for rules R1 and R2, 2|x| for R3 and R4), taken greedily by rule and then by
// descending |x|; the first `most` of it. Deterministic: ties are broken by star. Returned in an
// order that keeps near ones together.
template <int K>
std::vector<Target<K>> SelectIndependent(const StarComplex<K>& complex,
                                         std::vector<Target<K>> targets, std::size_t most);

}  // namespace stellate::core
