#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"
#include "core/rules/violation.h"

namespace stellate::core {

// Rule R5, protection (Chapters 7 and 8): each simplex of a star has a centre c and a circumradius
// R such that every sample point but its own vertices is farther from c than R + delta. A point in
// the shell between is nearly cospherical with the simplex: the two are a forbidden configuration,
// which a small change of the points, of their tangent spaces, or of the metric would
// retriangulate.
//
// A star in tangent spaces is tested at its own centres, one at common centres only for its lowest
// vertex. delta: a length, above 0.

// Returns the simplex of star(p) that breaks R5 and has the largest circumradius. REQUIRES: star(p)
// is closed, p is on no wall, and no circumradius exceeds the sample's epsilon.
template <int K>
std::optional<Violation<K>> WorstUnprotected(const Stars<K>& stars, std::uint32_t p, double delta);

// Counts the simplices that a tentative insertion would leave weak: new ones that break R5, and old
// ones that stay but whose shell the point is in. Stops counting at `enough`. `guest`: the point,
// with the id stars.size(). REQUIRES: as above.
template <int K>
int CountUnprotected(const Stars<K>& stars, const Site& guest,
                     const typename Stars<K>::Tentative& tentative, double delta, int enough);
// Counts the weak simplices that a tentative insertion would remove. Arguments: as above.
template <int K>
int CountResolved(const Stars<K>& stars, const Site& guest,
                  const typename Stars<K>::Tentative& tentative, double delta);

}  // namespace stellate::core
