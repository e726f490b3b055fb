#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"
#include "core/rules/r3_slivers.h"
#include "core/rules/violation.h"

namespace stellate::core {

// Tests R1 and R2, which need only star(p). Returns the worst simplex of the first rule that is
// broken, by R_p for R1 and by rho for R2. For rho it compares the edges at p; the stars of the
// other vertices compare the others.
//
// Tests faces of dimension `least` to `stage`, the lowest first. R2 also forbids foreign simplices.
// R2 and R3 skip simplices at points with protecting balls.
template <int K>
std::optional<Violation<K>> WorstSizeOrShape(const Stars<K>& stars, std::uint32_t p, double epsilon,
                                             double radius_edge_bound, int stage = K,
                                             int least = 1);

// Tests R3 and R4, which need the neighbours' stars, and star(p) closed. Returns the worst simplex,
// by R_p, of the first of these that occurs:
//
//   1. it is or contains a sliver, and p is its lowest vertex;
//   2. it is inconsistent, or, at common centres, it and a neighbour are on the same side of their
//      common facet in T_pM: then the star is not an embedded disk although its vertices agree;
//   3. it is tilted too far, and p is its lowest vertex;
//   4. it has a sharp dihedral angle, and p is its lowest vertex.
//
// Tests faces as above. `size_bound`: of R1 for p, length. `consistent`: simplices of p that are
// known to be consistent (ConsistentSimplices).
template <int K>
std::optional<Violation<K>> WorstSliverOrInconsistent(const Stars<K>& stars, std::uint32_t p,
                                                      const ShapeBounds& bounds, double size_bound,
                                                      int stage = K, std::uint64_t consistent = 0,
                                                      int least = 1);

}  // namespace stellate::core
