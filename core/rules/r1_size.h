#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"
#include "core/rules/violation.h"

namespace stellate::core {

// Rule R1, size (Sec. 5.3.5): no cell is unbounded, and no circumradius is larger than epsilon.

// Whether a simplex breaks R1. fake: not a simplex yet, as its cell is unbounded there. radius2:
// its circumradius, squared.
inline bool IsTooLarge(bool fake, double radius2, double epsilon) {
  return fake || radius2 > epsilon * epsilon;
}

// Returns the simplex of star(p) that breaks R1 and has the largest circumradius. REQUIRES: p is on
// no wall.
template <int K>
std::optional<Violation<K>> WorstSize(const Stars<K>& stars, std::uint32_t p, double epsilon);

}  // namespace stellate::core
