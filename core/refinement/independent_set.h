#pragma once

#include <cstdint>
#include <vector>

#include "core/complex/star_complex.h"
#include "core/refinement/rules.h"

namespace stellate::core {

// A refinement that a round may make: star `star` has a violation, to be mended by a point near
// star + T_star x.
template <int K>
struct Target {
  std::uint32_t star = 0;
  Violation<K> violation;
  double x[K] = {};   // where to insert, tangent coordinates: the circumcentre, or less far out
  double radius = 0;  // |x|
};

// The targets of one round: a maximal set in which no insertion point lies in the conflict ball of
// another (radius |x| for rules R1 and R2, 2|x| for R3 and R4), taken greedily by rule and then by
// descending |x|; the first `most` of it. Deterministic: ties are broken by star. Returned in an
// order that keeps near ones together.
template <int K>
std::vector<Target<K>> SelectIndependent(const StarComplex<K>& complex,
                                         std::vector<Target<K>> targets, std::size_t most);

}  // namespace stellate::core
