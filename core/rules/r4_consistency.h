#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"
#include "core/rules/violation.h"

namespace stellate::core {

// Rule R4, consistency (Sec. 5.3.5): each simplex of a star is in the stars of all its vertices
// (core/complex/consistency.h). At common centres, no simplex may be on the same side of a common
// facet in T_pM as its neighbour either: then the star is not an embedded disk although its
// vertices agree.

// Returns the simplex of star(p) that breaks R4 and has the largest circumradius. `consistent`:
// simplices of p that are known to be consistent (ConsistentSimplices). REQUIRES: p is on no wall,
// and star(p) is closed.
template <int K>
std::optional<Violation<K>> WorstInconsistent(const Stars<K>& stars, std::uint32_t p,
                                              std::uint64_t consistent);

}  // namespace stellate::core
