#pragma once

#include <vector>

#include "core/complex/star_complex.h"
#include "core/refinement/size_field.h"

namespace stellate::core {

// Sharp edges, k = 3: what refines one of the walls encroaches on the other and back, without end,
// at angles below some 50 degrees. So their points, and the corners where they end, are guarded by
// balls as of Cheng, Dey and Ramos: nothing is inserted in a ball, and where those of neighbours
// overlap nothing outside comes nearer to the edge than they are.
//
// The radii follow the distances: less than to the neighbours along the edge, a third of that to
// any other edge or corner. Where such balls do not overlap, the edge has to be split first.
template <int K>
struct Guards {
  std::vector<double> radii2;  // squared, by point, 0 where none is needed
  // The dual vertices of edges that are too long for their balls.
  std::vector<typename StarComplex<K>::CellVertex> gaps;
};

// REQUIRES: LacksGuards, and that no rule applies to edges and corners.
template <int K>
Guards<K> PlanGuards(const StarComplex<K>& complex, const SizeField<K>& sizes);

// Whether walls meet too sharply (SafeAngle) at some point that has no guard.
template <int K>
bool LacksGuards(const StarComplex<K>& complex);

}  // namespace stellate::core
