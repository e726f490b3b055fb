#pragma once

#include <cstdint>
#include <vector>

#include "core/places.h"
#include "core/reconstruction/assembly.h"
#include "core/reconstruction/fitted_cloud.h"

namespace stellate::core {

// What the points say against a mesh of them.
struct Causes {
  // By point of the cloud: kOk, or the first of kEdge, kSheets, kNoise, kSparse that holds there;
  // where the assembly left a place unresolved also kClose and kDisagree.
  std::vector<Place> places;
  // Points that were in the way of the mesh: unresolved, or with evidence against it.
  std::uint64_t count = 0;
};

// Finds at each point, except those added, why its place is not resolved, or may be wrong although
// it is: the star is open or reaches far; a point above it is nearer than it should be, or
// residuals are those of two sheets; the noise is more than half of the spacing, or the point is an
// outlier; tangent spaces turn by more than 60 degrees along an edge, or, where stars disagree, by
// more than 15 from point to point. What so few points leave open, whether they are noisy or M
// bends, is kSparse, too. `edges_allowed`: M may have a boundary, and an open star that is resolved
// is none of these.
Causes FindCauses(const FittedCloud& cloud, const Assembly& assembly, bool edges_allowed);

}  // namespace stellate::core
