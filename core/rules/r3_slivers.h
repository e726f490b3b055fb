#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "core/complex/stars.h"
#include "core/rules/violation.h"

namespace stellate::core {

// Rule R3, slivers (Sec. 5.3.5): no simplex is or contains a Theta0-sliver. Beyond the thesis, none
// may be tilted too far for a proof, or have a sharp dihedral angle, where that is asked for.
// Simplices at points with protecting balls are excused from slivers.
//
// A simplex is tested in the star of its lowest vertex: if it is not there, it is inconsistent
// anyway.

// The bounds of R3 on the shape of a simplex, and that of R5.
struct ShapeBounds {
  double sliver_bound = 0;  // Theta0; 0: none
  // The declared reach, length: no simplex may be tilted so far from a vertex's tangent space that
  // ProveFromReach would fail (core/certificate/claims/proof.h). Infinity: any tilt is allowed.
  double reach = INFINITY;
  // The cosine of the least dihedral angle of tetrahedra. 1: any angle is allowed.
  double sharpest_cosine = 1;
  // Any angle is allowed, too, where the circumradius is below this share of the size bound.
  double sharp_radius = 0;
  // R5: the least gap of a simplex, length (core/rules/r5_protection.h). 0: any.
  double protection = 0;
};

// Whether p is the lowest vertex of the simplex dual to vertex v of p's cell.
template <int K>
bool IsLowest(std::uint32_t p, const RestrictedVoronoiCell<K>& cell, std::size_t v) {
  for (int s = 0; s < K; ++s)
    if (cell.id(cell.facet(v, s)) < p) return false;
  return true;
}

// Whether the simplex on p and the facets of v is or contains a Theta0-sliver (Sec. 2.3): that is,
// whether some face at p, of dimension j >= 2, has fatness below Theta0^j. `unborn`: the point with
// the id stars.size(), which is not in the sample, or nullptr.
template <int K>
bool HasThinFaceAt(const Stars<K>& stars, const double* p, const RestrictedVoronoiCell<K>& cell,
                   std::size_t v, double sliver_bound, const double* unborn);

// Whether the simplex on p and the facets of v is tilted too far from the tangent space of one of
// its vertices for a proof from this reach, or is so large that M itself may turn too far under it.
// `unborn`: as above; it has no tangent space yet.
template <int K>
bool TiltsTooFar(const Stars<K>& stars, std::uint32_t p, const double* at,
                 const RestrictedVoronoiCell<K>& cell, std::size_t v, double reach,
                 const double* unborn);

// Whether the simplex on p and the facets of v has all its vertices on one wall and no volume in
// p's tangent space. Stars may agree on such a simplex if the wall's own simplices and those inside
// split cospherical points of a flat wall differently.
template <int K>
bool IsFlatOnWall(const Stars<K>& stars, std::uint32_t p, const RestrictedVoronoiCell<K>& cell,
                  std::size_t v);

// Each returns the simplex of star(p) with the largest circumradius that is or contains a sliver,
// is tilted too far, or has a sharp dihedral angle, and whose lowest vertex is p. REQUIRES: star(p)
// is closed and, of the first two, p is on no wall.
template <int K>
std::optional<Violation<K>> WorstSliver(const Stars<K>& stars, std::uint32_t p,
                                        double sliver_bound);
template <int K>
std::optional<Violation<K>> WorstTilted(const Stars<K>& stars, std::uint32_t p, double reach);
// size_bound: of R1 for p, length.
template <int K>
std::optional<Violation<K>> WorstSharpAngle(const Stars<K>& stars, std::uint32_t p,
                                            const ShapeBounds& bounds, double size_bound);

}  // namespace stellate::core
