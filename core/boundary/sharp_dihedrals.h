#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"

namespace stellate::core {

// Sharp dihedral angles of tetrahedra, k = 3, which simplices may have without being slivers. An
// angle is sharp if its cosine is larger than `cosine`, and no walls meet as sharply along its
// edge.

// Whether the simplex on p, at `at`, and the facets of v has a sharp angle. `unborn`: as for
// HasThinFaceAt.
template <int K>
bool HasSharpDihedral(const Stars<K>& stars, std::uint32_t p, const double* at,
                      const RestrictedVoronoiCell<K>& cell, std::size_t v, double cosine,
                      const double* unborn);

// Returns the dual vertex of the largest simplex of star(p) with a sharp angle whose lowest vertex
// is p and whose circumradius is larger than `least_radius`.
template <int K>
std::optional<std::size_t> WorstSharp(const Stars<K>& stars, std::uint32_t p, double cosine,
                                      double least_radius, int sector = 0);

}  // namespace stellate::core
