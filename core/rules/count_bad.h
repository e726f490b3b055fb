#pragma once

#include "core/complex/stars.h"
#include "core/rules/r3_slivers.h"

namespace stellate::core {

// Counts the bad simplices that a tentative insertion would make: new slivers of circumradius at
// most `small_radius`, simplices that stars would disagree about, and foreign ones. Stops counting
// at `enough`. `walls`, `signs`: of the point, as of Site.
template <int K>
int CountBad(const Stars<K>& stars, const double* point,
             const typename Stars<K>::Tentative& tentative, const ShapeBounds& bounds,
             double small_radius, int enough, WallSet walls = 0, WallSet signs = 0);

}  // namespace stellate::core
