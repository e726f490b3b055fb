#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"
#include "core/rules/violation.h"

namespace stellate::core {

// Rule R2, radius-edge ratio (Sec. 5.3.5): no circumradius is longer than `bound` times the
// shortest edge. It compares the edges at p; the stars of the other vertices compare the others.
// Simplices at points with protecting balls are excused.

// Whether the simplex dual to vertex v of p's cell breaks R2. edge2: its shortest edge, squared.
template <int K>
bool HasShortEdge(const Stars<K>& stars, std::uint32_t p, const RestrictedVoronoiCell<K>& cell,
                  std::size_t v, double edge2, double bound) {
  return cell.norm2(v) > bound * bound * edge2 && !stars.TouchesProtectingBall(p, cell, v);
}

// Returns the simplex of star(p) that breaks R2 and has the largest ratio. REQUIRES: p is on no
// wall, and star(p) does not break R1.
template <int K>
std::optional<Violation<K>> WorstRadiusEdge(const Stars<K>& stars, std::uint32_t p, double bound);

}  // namespace stellate::core
