#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "core/complex/consistency.h"
#include "core/complex/star_complex.h"

namespace stellate::core {

// The refinement rules of Sec. 5.3.5, in their order.
enum class Rule : std::uint8_t { kSize = 0, kRadiusEdge, kSliver, kInconsistent };

// What R3 asks of a simplex's shape.
struct ShapeBounds {
  double sliver_bound = 0;  // Theta0; 0: none
  // Of the declared reach, length: no simplex may lean so far from a vertex's tangent space that
  // ProveFromReach would fail (core/certificate/proof.h). Infinity: they may.
  double reach = INFINITY;
  // Of the least dihedral angle that tetrahedra shall have. 1: it may be any.
  double sharpest_cosine = 1;
  // It may be any, too, where the circumradius is smaller than this share of the size asked for.
  double sharp_radius = 0;
};

// A simplex of star(p) that breaks a rule, given by its dual vertex in p's cell.
template <int K>
struct Violation {
  Rule rule = Rule::kSize;
  double radius = 0;       // R_p(sigma), length
  double x[K] = {};        // c_p(sigma) in p's tangent coordinates
  std::size_t vertex = 0;  // of p's cell, as long as that does not change
  bool fake = false;       // not a simplex yet: the cell is unbounded there
  bool lean = false;       // of R3: it is no sliver, but leans too far for a proof
  bool sharp = false;      // of R3: it is no sliver, but has a sharp dihedral angle
  WallSet walls = 0;       // of the dual vertex: the simplex is one of their face
  bool split = false;      // it breaks no rule, but a point off its face would come too near

  int dimension() const { return K - CountWalls(walls); }
};

// R1 and R2, which need star(p) alone: the worst simplex of the first rule that one breaks, by R_p
// for R1 and by rho for R2. Of rho, star(p) looks at the edges at p: the others are at some other
// vertex of the simplex, whose star looks at them.
//
// Faces of dimension `least` to `stage` are looked at, those of the lowest dimension first; to R2
// there belongs that no simplex is foreign. R2 and R3 leave simplices at guarded points alone.
template <int K>
std::optional<Violation<K>> WorstSizeOrShape(const StarComplex<K>& complex, std::uint32_t p,
                                             double epsilon, double radius_edge_bound,
                                             int stage = K, int least = 1);

// R3 and R4, which need the neighbours' stars, and star(p) closed: first the worst simplex, by R_p,
// that is or contains a sliver and whose lowest vertex p is, then the worst one that is
// inconsistent, or, where stars are judged at common centres, that lies on the same side as a
// neighbour of the facet they share in T_pM: such a star is no embedded disk although all its
// vertices agree on it; then the worst one whose lowest vertex p is and that leans too far, or else
// that has a sharp dihedral angle. Of faces as above, those of the lowest dimension first.
// `size_bound`: of R1 for p, length. `consistent`: what is known of p already
// (ConsistentSimplices).
template <int K>
std::optional<Violation<K>> WorstSliverOrInconsistent(const StarComplex<K>& complex,
                                                      std::uint32_t p, const ShapeBounds& bounds,
                                                      double size_bound, int stage = K,
                                                      std::uint64_t consistent = 0, int least = 1);

// Whether the simplex on p and the facets of v is or contains a Theta0-sliver (Sec. 2.3): that is,
// whether some face at p, of dimension 2 or more, has fatness below Theta0^j.
template <int K>
bool HasThinFaceAt(const StarComplex<K>& complex, const double* p,
                   const RestrictedVoronoiCell<K>& cell, std::size_t v, double sliver_bound,
                   const double* unborn);

// Whether the simplex on p and the facets of v leans too far from the tangent space of one of its
// vertices for a proof from this reach, or is so large that M itself may turn too far under it.
// `unborn` as above: it has no tangent space yet.
template <int K>
bool LeansTooFar(const StarComplex<K>& complex, std::uint32_t p, const double* at,
                 const RestrictedVoronoiCell<K>& cell, std::size_t v, double reach,
                 const double* unborn);

// How bad a tentative insertion would leave its surroundings: the new slivers of circumradius at
// most `small_radius`, the simplices that stars would disagree about, and foreign ones. Counts no
// further than `enough`. `walls`: that the point is on.
template <int K>
int CountBad(const StarComplex<K>& complex, const double* point,
             const typename StarComplex<K>::Tentative& tentative, const ShapeBounds& bounds,
             double small_radius, int enough, WallSet walls = 0);

}  // namespace stellate::core
