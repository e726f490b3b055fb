#pragma once

#include <cstdint>
#include <vector>

#include "core/complex/stars.h"

namespace stellate::core {

// If the stars disagree about few simplices, the consistent ones are a mesh except for cavities:
// each facet is in at most two of them, and the facets in one bound the cavities. A cavity can be
// filled without a new point.
//
// A filling is a set of simplices on the cavity's vertices, each oriented alike in the tangent
// spaces of all its vertices, whose oriented boundary, with that of the consistent simplices,
// cancels on each facet. Such a chain covers each point as often as its boundary winds around it,
// and that is once: it tiles the cavity. The search goes facet by facet, the one with the fewest
// choices first, and tries simplices that more stars hold, and then fatter ones, first. At a wall
// the cavity ends: what stars agree on there has one side. Of an arrangement, each region has its
// own cavities, which the walls between them part.
//
// The filled mesh is not the union of the stars, so that only the certificate can judge it.

// The bounds on a filling simplex, the same as on all others.
struct FillingRules {
  double epsilon = 0;            // circumradius in its hull at most this, length
  double radius_edge_bound = 0;  // rho0
  double sliver_bound = 0;       // Theta0
};

struct FilledCavities {
  std::uint64_t inconsistent = 0;  // simplices about which stars disagree, each counted once
  std::uint64_t cavities = 0;
  std::uint64_t filled = 0;
  std::uint64_t filling = 0;             // simplices of all fillings
  std::vector<std::uint32_t> simplices;  // consistent and filling ones, K+1 ids each, sorted
  std::vector<std::uint32_t> unfilled;   // vertices of the cavities that are not filled, ascending
  std::vector<std::uint32_t> tiled;      // of those that are
};

// Fills the cavities that it can. A simplex is consistent here if the stars of all its vertices
// hold it and it is folded over a neighbour in none of them. Deterministic, parallel; time linear
// in the mesh, and bounded for each cavity.
template <int K>
FilledCavities FillCavities(const Stars<K>& stars, const FillingRules& rules);

}  // namespace stellate::core
