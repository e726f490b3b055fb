#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"

namespace stellate::core {

// Sharp dihedral angles of tetrahedra, k = 3, which simplices may have without being slivers. An
// angle is sharp if its cosine is larger than `cosine`, and no walls meet as sharply along its edge
// themselves.

// Whether the simplex on p, which is `at`, and the facets of v has one. `unborn`: as of
// HasThinFaceAt.
template <int K>
bool HasSharpDihedral(const Stars<K>& stars, std::uint32_t p, const double* at,
                      const RestrictedVoronoiCell<K>& cell, std::size_t v, double cosine,
                      const double* unborn);

// Of the simplices of star(p) that have one, whose lowest vertex p is, and whose circumradius is
// larger than `least_radius`: the largest, by its dual vertex.
template <int K>
std::optional<std::size_t> WorstSharp(const Stars<K>& stars, std::uint32_t p, double cosine,
                                      double least_radius);

}  // namespace stellate::core
