#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "core/complex/consistency.h"
#include "core/complex/stars.h"

namespace stellate::core {

// The refinement rules of Sec. 5.3.5, in their order.
enum class Rule : std::uint8_t { kSize = 0, kRadiusEdge, kShape, kInconsistent };

// The bounds of R3 on the shape of a simplex.
struct ShapeBounds {
  double sliver_bound = 0;  // Theta0; 0: none
  // The declared reach, length: no simplex may be tilted so far from a vertex's tangent space that
  // ProveFromReach would fail (core/certificate/claims/proof.h). Infinity: any tilt is allowed.
  double reach = INFINITY;
  // The cosine of the least dihedral angle of tetrahedra. 1: any angle is allowed.
  double sharpest_cosine = 1;
  // Any angle is allowed, too, where the circumradius is below this share of the size bound.
  double sharp_radius = 0;
};

// A simplex of star(p) that breaks a rule, or that must be split to protect its face;
// given by its dual vertex in p's cell.
template <int K>
struct Violation {
  Rule rule = Rule::kSize;
  double radius = 0;        // R_p(sigma), length
  double x[K] = {};         // c_p(sigma) in p's tangent coordinates
  std::size_t vertex = 0;   // of p's cell; valid until that changes
  bool fake = false;        // not a simplex yet: the cell is unbounded there
  bool tilted = false;      // R3: not a sliver, but tilted too far for a proof
  bool sharp = false;       // R3: not a sliver, but has a sharp dihedral angle
  WallSet walls = 0;        // of the dual vertex: the simplex is one of their face
  bool encroached = false;  // breaks no rule, but a point off its face would come too near

  int dimension() const { return K - CountWalls(walls); }
};

// Tests R1 and R2, which need only star(p). Returns the worst simplex of the first rule that is
// broken, by R_p for R1 and by rho for R2. For rho it compares the edges at p; the stars of the
// other vertices compare the others.
//
// Tests faces of dimension `least` to `stage`, the lowest first. R2 also forbids foreign simplices.
// R2 and R3 skip simplices at points with protecting balls.
template <int K>
std::optional<Violation<K>> WorstSizeOrShape(const Stars<K>& stars, std::uint32_t p, double epsilon,
                                             double radius_edge_bound, int stage = K,
                                             int least = 1);

// Tests R3 and R4, which need the neighbours' stars, and star(p) closed. Returns the worst simplex,
// by R_p, of the first of these that occurs:
//
//   1. it is or contains a sliver, and p is its lowest vertex;
//   2. it is inconsistent, or, at common centres, it and a neighbour are on the same side of their
//      common facet in T_pM: then the star is not an embedded disk although its vertices agree;
//   3. it is tilted too far, and p is its lowest vertex;
//   4. it has a sharp dihedral angle, and p is its lowest vertex.
//
// Tests faces as above. `size_bound`: of R1 for p, length. `consistent`: simplices of p that are
// known to be consistent (ConsistentSimplices).
template <int K>
std::optional<Violation<K>> WorstSliverOrInconsistent(const Stars<K>& stars, std::uint32_t p,
                                                      const ShapeBounds& bounds, double size_bound,
                                                      int stage = K, std::uint64_t consistent = 0,
                                                      int least = 1);

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

// Counts the bad simplices that a tentative insertion would make: new slivers of circumradius at
// most `small_radius`, simplices that stars would disagree about, and foreign ones. Stops counting
// at `enough`. `walls`: the walls of the point.
template <int K>
int CountBad(const Stars<K>& stars, const double* point,
             const typename Stars<K>::Tentative& tentative, const ShapeBounds& bounds,
             double small_radius, int enough, WallSet walls = 0);

}  // namespace stellate::core
