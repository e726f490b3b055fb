#pragma once

#include "core/complex/stars.h"
#include "core/rules/r3_slivers.h"

namespace stellate::core {

// Counts the bad simplices that a tentative insertion would make: new slivers of circumradius at
// most `small_radius`, simplices that stars would disagree about, foreign ones, and where
// `bounds.protection` is set those that it would leave unprotected. Stops counting at `enough`.
// `guest`: the point, with the id stars.size().
template <int K>
int CountBad(const Stars<K>& stars, const Site& guest,
             const typename Stars<K>::Tentative& tentative, const ShapeBounds& bounds,
             double small_radius, int enough);

}  // namespace stellate::core
