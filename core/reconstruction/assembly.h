#pragma once

#include <cstdint>
#include <vector>

#include "core/base/function_ref.h"
#include "core/places.h"
#include "core/reconstruction/fitted_cloud.h"

namespace stellate::core {

// A mesh of a cloud: what the stars agree on, and how the rest was resolved.
struct Assembly {
  std::vector<std::uint32_t> simplices;  // k+1 ascending ids of the cloud each, sorted
  // By point of the cloud: kOk, kDropped, kTiled, kWeighted; or kDisagree where it is not resolved.
  std::vector<Place> places;
  std::vector<double> radii;    // by point: the star's largest circumradius, infinite if it is open
  std::vector<double> weights;  // by point, squared lengths; empty: none
  std::uint64_t doubtful = 0, cavities = 0, tiles = 0;
};

// Assembles the mesh: stars, in tangent spaces for k <= 2 and at common centres else; tilings of
// the cavities where they disagree; where that does not fill all, stars in tangent spaces; weights
// at the cavities that are left; and fewer points there, up to `most_dropped`. Weights and drops
// change only what is near. `exudes`, for k = 3: weights of all points come first, by which stars
// in tangent spaces agree and have few slivers; what they do not settle is assembled as ever.
// `done`: is called with the share of the work done.
template <int K>
Assembly Assemble(const FittedCloud& cloud, std::uint64_t most_dropped, bool exudes,
                  FunctionRef<void(double)> done);

}  // namespace stellate::core
