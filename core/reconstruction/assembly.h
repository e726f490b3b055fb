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
  // By point of the cloud: kOk, kDropped, kTiled, kWeighted, kAdded; or kDisagree where it is not
  // resolved.
  std::vector<Place> places;
  std::vector<double> radii;    // by point: the star's largest circumradius, infinite if it is open
  std::vector<double> weights;  // by point, squared lengths; empty: none
  std::uint64_t doubtful = 0, cavities = 0, tiles = 0;
};

// By what stars that disagree are made to agree.
struct AssemblyRequest {
  std::uint64_t most_dropped = 0;  // points that may be left out
  std::uint64_t most_added = 0;    // points that may be added
  // Weights of all points come first, by which stars in tangent spaces agree and have few slivers;
  // what they do not settle is assembled as ever.
  bool exudes = false;
  // The same, but last: only where something is left, and only if they settle all.
  bool exudes_at_last = false;
  // Nothing but these weights: the mesh is what the stars agree on.
  bool weights_only = false;
};

// Assembles the mesh: stars, in tangent spaces for k <= 2 and at common centres else; tilings of
// the cavities where they disagree; where that does not fill all, stars in tangent spaces; weights
// at the cavities that are left; fewer points there; and then points added to the cloud there,
// after its own. Weights, drops and additions change only what is near. `done`: is called with the
// share of the work done.
template <int K>
Assembly Assemble(FittedCloud* cloud, const AssemblyRequest& request,
                  FunctionRef<void(double)> done);

}  // namespace stellate::core
