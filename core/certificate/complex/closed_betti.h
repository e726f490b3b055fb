#pragma once

#include <cstdint>
#include <vector>

#include "core/certificate/complex/topology.h"

namespace stellate::core {

// Returns the Betti numbers over Z/2, from dimension 0 on, of a closed manifold; empty for k > 3,
// and for k = 3 of more than a million simplices: they are not computed. Of k = 1 and 2 they follow
// from the number of components and the Euler characteristic, of k = 3 the first, which is also the
// second, takes nearly linear time, below 1 us a simplex on a torus of 750,000.
//
// REQUIRES: each facet is in two simplices, each vertex link is a sphere.
std::vector<std::int64_t> ClosedBettiNumbers(const SimplexList& list, std::int64_t components,
                                             std::int64_t euler_characteristic);

}  // namespace stellate::core
