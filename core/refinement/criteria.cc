#include "core/refinement/criteria.h"

#include <algorithm>
#include <cmath>

#include "core/boundary/boundary_policy.h"
#include "core/geometry/reach.h"

namespace stellate::core {
namespace {

// Cells begin as fake simplices a little larger than the step of the front.
constexpr double kInradius = 1.2;
// Theta0 by k: for k <= 2 none is needed. A regular simplex's fatness falls quickly with k, so the
// bound falls with it. For k = 3 0.25 takes 1 to 7 % more vertices than 0.2, and simplices tilt a
// third less. With walls angles are bounded, and 0.2 is enough.
constexpr double kDefaultSliverBound[kMaxDimension + 1] = {0, 0, 0, 0.25, 0.15, 0.1};
constexpr double kSliverBoundWithWalls = 0.2;
// Beyond this bound ten candidates of a picking region are too few to find a point that makes no
// new sliver, and refinement does not end; 40 are enough at 0.3, the largest bound, with 6 to 25 %
// more vertices.
constexpr double kFatter = 0.25;
constexpr int kCandidates = 10, kCandidatesForFatter = 40;
// Of fewer candidates too often none is outside of all shells.
constexpr int kCandidatesForProtection = 30;

// The least dihedral angles of tetrahedra. Slivers of the bounds above have mostly more, so that 14
// degrees cost closed manifolds 0.2 % more vertices at most, and 18 with the fatter nothing to
// measure; solids 5 %, and T^3 cut by a half-space 1 % for the 10 degrees of manifolds whose walls
// are found by queries.
constexpr double kCosineOf18Degrees = 0.95105651629515353, kCosineOf14Degrees = 0.97029572627599647,
                 kCosineOf10Degrees = 0.98480775301220806;
// The rule applies down to this share of the size bound, so that it ends: near sharp edges faces
// are as fine.
constexpr double kSharpRadius = 0.1;

// With a declared reach, M turns by no more than 0.7 radians under a simplex within the size bound.
// The rest of the right angle is for the tilt of the simplex.
constexpr double kSineOfHalfProofTurn = 0.34289780745545134;

constexpr double kDefaultAdvanceEpsilons = 3;
constexpr double kDefaultAdvanceShare = 0.1;  // of the bounding box's diagonal

// For k = 3.
double SharpestCosine(const Specification& spec, double sliver_bound) {
  if (BoundaryPolicy(spec).SharpensDihedrals())  // 18 degrees do not always end there
    return spec.ambient_dimension == 3 ? kCosineOf14Degrees : kCosineOf10Degrees;
  return sliver_bound > kFatter ? kCosineOf18Degrees : kCosineOf14Degrees;
}

double DefaultSliverBound(const Specification& spec) {
  return BoundaryPolicy(spec).SharpensDihedrals() ? kSliverBoundWithWalls
                                                  : kDefaultSliverBound[spec.dimension];
}

}  // namespace

ResolvedCriteria Resolve(const Specification& spec) {
  const Criteria& c = spec.criteria;
  ResolvedCriteria r;
  r.epsilon = spec.epsilon;
  if (spec.declared_reach) {
    r.shape.reach = *spec.declared_reach;
    r.epsilon = std::min(r.epsilon, RadiusOfHalfTurn(kSineOfHalfProofTurn, r.shape.reach));
  }
  r.radius_edge_bound = c.radius_edge_bound;
  r.shape.sliver_bound = c.sliver_bound.value_or(DefaultSliverBound(spec));
  if (spec.dimension == 3 && r.shape.sliver_bound > 0) {
    r.shape.sharpest_cosine = SharpestCosine(spec, r.shape.sliver_bound);
    r.shape.sharp_radius = kSharpRadius;
  }
  r.picking_radius = c.picking_radius;
  r.small_sliver_radius = c.small_sliver_radius;
  r.shape.protection = c.protection * r.epsilon;
  r.candidates = c.candidates.value_or(r.shape.sliver_bound > kFatter ? kCandidatesForFatter
                                       : c.protection > 0             ? kCandidatesForProtection
                                       : spec.dimension <= 2          ? 1
                                                                      : kCandidates);
  r.flat_alternations = c.flat_alternations;
  r.speculative = c.speculative;
  r.size_rate = c.size_rate.value_or(INFINITY);
  r.max_deviation = c.max_deviation.value_or(INFINITY);
  // Common centres have a meaning well below the local feature size; they are computed up to
  // epsilon, which is far above it if the size is graded.
  const bool flats = spec.dimension <= 2 || r.graded();
  r.centre_rule =
      c.centre_rule.value_or(flats ? CentreRule::kTangentSpace : CentreRule::kCommonCentre);
  r.sizes_given = r.graded() && spec.oracle.local_size;
  double step = kDefaultAdvanceEpsilons * r.epsilon;
  if (spec.bounding_box) {
    const double diagonal = (spec.bounding_box->upper - spec.bounding_box->lower).norm();
    step = std::max(step, kDefaultAdvanceShare * diagonal);
  }
  r.advance_step = c.advance_step.value_or(step);
  r.inradius = kInradius * std::max(r.advance_step, r.epsilon);
  return r;
}

}  // namespace stellate::core
