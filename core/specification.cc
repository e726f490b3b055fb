#include "core/specification.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "core/base/instantiate.h"
#include "core/base/message.h"
#include "core/field_status.h"
#include "core/label_table.h"
#include "core/list_walls.h"

namespace stellate::core {
namespace {

bool IsCoordinate(double value) { return std::abs(value) <= kMaxLength; }

std::string LengthRule() { return Message("a length between ", kMinLength, " and ", kMaxLength); }

Status CheckDimensions(const Specification& spec) {
  const int k = spec.dimension;
  const int d = spec.ambient_dimension;
  if (k < 1) {
    return Invalid("dimension",
                   Message("dimension (k) is ", k,
                           " but must be at least 1: set it to the dimension of the manifold"));
  }
  if (k > kMaxDimension) {
    return TooLarge("dimension",
                    Message("dimension (k) is ", k, " but manifolds of dimension up to ",
                            kMaxDimension, " are meshed: mesh a manifold of lower dimension"));
  }
  if (k > LargestDimension()) {
    return TooLarge(
        "dimension",
        Message("dimension (k) is ", k, " but this build meshes manifolds of dimension ", "up to ",
                LargestDimension(), ", to compile sooner: ",
                "build it with STELLATE_HIGH_DIMENSIONS=ON, as clients/quickstart --all ",
                "and cmake --preset release do"));
  }
  if (d > kMaxAmbientDimension) {
    return TooLarge(
        "ambient_dimension",
        Message("ambient_dimension (d) is ", d, " but may be at most ", kMaxAmbientDimension,
                ": map the manifold into a space of lower dimension first"));
  }
  if (spec.walls > 0 && k == d) return Status::Ok();  // a domain of R^d
  if (k >= d) {
    return Invalid("dimension",
                   Message("dimension (k) is ", k, " and ambient_dimension (d) is ", d,
                           " but k must be less than d: a closed manifold of dimension k needs "
                           "at least k + 1 coordinates"));
  }
  return Status::Ok();
}

Status CheckLabels(const Specification& spec) {
  if (spec.walls > kMaxLabelledWalls)
    return TooLarge("labels", Message("labels are set for ", spec.walls, " walls but at most ",
                                      kMaxLabelledWalls, " walls may have labels"));
  if (spec.labels.size() != std::size_t{1} << spec.walls)
    return Invalid("labels", Message("labels has ", spec.labels.size(), " entries where ",
                                     spec.walls, " walls have ", std::size_t{1} << spec.walls,
                                     " sign vectors: give one for each"));
  const auto worst = std::min_element(spec.labels.begin(), spec.labels.end());
  if (*worst < LabelTable::kImpossible)
    return Invalid("labels", Message("labels[", worst - spec.labels.begin(), "] is ", int{*worst},
                                     " but must be 0, outside of the manifold, or more, or ",
                                     LabelTable::kImpossible, " where no point has these signs"));
  if (std::all_of(spec.labels.begin(), spec.labels.end(), [](int label) { return label <= 0; }))
    return Invalid("labels", "labels are all 0: they leave nothing of the manifold");
  if (spec.criteria.speculative)
    return Invalid("criteria.speculative",
                   "criteria.speculative is set together with labels: on a surrogate nothing is "
                   "known of the walls' signs; leave one of them out");
  return Status::Ok();
}

Status CheckClosures(const Specification& spec) {
  if (spec.closures.size() > kMaxClosures)
    return TooLarge("closures", Message("closures has ", spec.closures.size(),
                                        " sets but may have at most ", kMaxClosures));
  for (std::size_t i = 0; i < spec.closures.size(); ++i) {
    const WallSet set = spec.closures[i];
    if (!IsSubset(set, SetOfWall(spec.walls) - 1) || CountWalls(set) < 3)
      return Invalid("closures",
                     Message("closures[", i, "] is of walls ", ListWalls(set),
                             " but must be of three walls or more, each below ", spec.walls,
                             ": each has to be zero wherever all others of them are"));
  }
  return Status::Ok();
}

Status CheckBoundaryOnly(const Specification& spec) {
  if (spec.walls == 0)
    return Invalid("boundary_only",
                   "boundary_only is set without walls: a manifold without walls has no boundary");
  if (spec.dimension < 2)
    return Invalid("boundary_only",
                   "boundary_only is set for a curve, whose boundary is points: leave it out");
  if (spec.components > 0 && spec.dimension < spec.ambient_dimension)
    return Invalid("components",
                   Message("components is set together with boundary_only, for a manifold of "
                           "dimension ",
                           spec.dimension, " in R^", spec.ambient_dimension,
                           ": only where it fills space the boundary tells how many components it "
                           "belongs to; leave one of them out"));
  return Status::Ok();
}

Status CheckWalls(const Specification& spec) {
  if (spec.walls == 0 && !spec.labels.empty())
    return Invalid("labels", "labels are set without walls, whose sign vectors they are of");
  if (spec.labels.empty() && !spec.closures.empty())
    return Invalid("closures",
                   "closures are set without labels: they are of the walls of an arrangement");
  if (spec.walls == 0) return Status::Ok();
  if (spec.walls < 0 || spec.walls > kMaxWalls) {
    return Invalid("walls", Message("walls is ", spec.walls, " but must be between 0 and ",
                                    kMaxWalls, ": unite walls that do not meet into one"));
  }
  if (!spec.oracle.conormals || !spec.oracle.tangent_basis) {
    return Invalid("walls",
                   "walls is set: the oracle must give tangent bases and, with points of faces, "
                   "conormals, whose coordinates are in these bases");
  }
  if (!spec.labels.empty()) {
    if (Status status = CheckLabels(spec); !status.ok()) return status;
    if (Status status = CheckClosures(spec); !status.ok()) return status;
  }
  if (spec.declared_reach || spec.cover_box) {
    return Invalid("declared_reach",
                   "declared_reach is set together with walls, but only manifolds without boundary "
                   "can be proved: leave one of them out");
  }
  return Status::Ok();
}

Status CheckEpsilon(double epsilon) {
  if (IsLength(epsilon)) return Status::Ok();
  return Invalid("epsilon",
                 Message("epsilon is ", epsilon, " but must be ", LengthRule(),
                         ": give the largest circumradius that a simplex may have, in the unit of "
                         "the coordinates"));
}

Status CheckBox(const BoundingBox& box, int d) {
  for (const auto* side : {&box.lower, &box.upper}) {
    const char* name = side == &box.lower ? "bounding_box.lower" : "bounding_box.upper";
    if (side->size() != d) {
      return Invalid(
          name, Message(name, " has ", side->size(), " coordinates but ambient_dimension is ", d,
                        ": give one coordinate for each ambient axis"));
    }
    for (int i = 0; i < d; ++i) {
      if (!IsCoordinate((*side)[i])) {
        return Invalid(name, Message(name, " is ", (*side)[i], " in coordinate ", i,
                                     " but must be finite and at most ", kMaxLength,
                                     " in size: give a box that encloses the manifold"));
      }
    }
  }
  for (int i = 0; i < d; ++i) {
    if (!(box.lower[i] < box.upper[i])) {
      return Invalid("bounding_box",
                     Message("bounding_box is empty in coordinate ", i, ": lower is ", box.lower[i],
                             " and upper is ", box.upper[i],
                             " but lower must be less than upper; swap or widen them"));
    }
  }
  return Status::Ok();
}

Status CheckSeeds(const Specification& spec) {
  const Eigen::MatrixXd& seeds = spec.seeds;
  if (seeds.cols() == 0 && !spec.bounding_box) {
    return Invalid(
        "bounding_box",
        "neither seeds nor bounding_box is given: give points near the manifold, or a box that "
        "encloses it");
  }
  if (seeds.cols() > 0 && seeds.rows() != spec.ambient_dimension) {
    return Invalid("seeds",
                   Message("seeds have ", seeds.rows(), " coordinates each but ambient_dimension ",
                           "is ", spec.ambient_dimension, ": give points of the ambient space"));
  }
  for (Eigen::Index j = 0; j < seeds.cols(); ++j) {
    for (Eigen::Index i = 0; i < seeds.rows(); ++i) {
      if (!IsCoordinate(seeds(i, j))) {
        return Invalid("seeds", Message("seeds is ", seeds(i, j), " in coordinate ", i, " of seed ",
                                        j, " but must be finite and at most ", kMaxLength,
                                        " in size: remove or correct that seed"));
      }
    }
  }
  if (spec.components < 0 || spec.components > kMaxComponents) {
    return Invalid(
        "components",
        Message("components is ", spec.components, " but must be between 0 and ", kMaxComponents,
                ": say how many the manifold has at least, or 0 if that is not known"));
  }
  if (spec.box_seeds < 0 || spec.box_seeds > kMaxBoxSeeds) {
    return Invalid("box_seeds",
                   Message("box_seeds is ", spec.box_seeds, " but must be between 0 and ",
                           kMaxBoxSeeds, "; 0 asks for the default"));
  }
  if (std::int64_t{spec.box_seeds} * spec.ambient_dimension > kMaxBoxSeedCoordinates) {
    return TooLarge("box_seeds",
                    Message("box_seeds is ", spec.box_seeds, " but in R^", spec.ambient_dimension,
                            " may be at most ", kMaxBoxSeedCoordinates / spec.ambient_dimension,
                            ": a few hundred find all but the smallest components"));
  }
  return Status::Ok();
}

// Seeds that cover a box lie in the middle of cells whose corners are this share of the reach away,
// moved a little, so that symmetric manifolds have none on their axes, where oracles divide by
// zero. They are moved by at most that share of a cell, which adds twice that share to the distance
// from a corner: it stays below the reach.
constexpr double kCoverShare = 0.97;
constexpr double kOffMiddle = 0.01;

// Returns the number of seeds along each axis.
Eigen::VectorXd CoverCounts(const Specification& spec) {
  const BoundingBox& box = *spec.bounding_box;
  const double cell = 2 * kCoverShare * *spec.declared_reach /
                      std::sqrt(static_cast<double>(spec.ambient_dimension));
  return ((box.upper - box.lower) / cell).array().ceil().max(1.0);
}

Status CheckReach(const Specification& spec) {
  if (spec.declared_reach && !IsLength(*spec.declared_reach)) {
    return Invalid("declared_reach",
                   Message("declared_reach is ", *spec.declared_reach, " but must be ",
                           LengthRule(), ": a lower bound of the manifold's reach"));
  }
  if (!spec.cover_box) return Status::Ok();
  if (!spec.declared_reach || !spec.bounding_box || spec.seeds.cols() > 0) {
    return Invalid("cover_box",
                   "cover_box is set: give declared_reach and bounding_box, by which the seeds are "
                   "placed, and "
                   "no seeds");
  }
  const double count = CoverCounts(spec).prod();
  const auto fit = kMaxBoxSeedCoordinates / spec.ambient_dimension;
  const double most = std::min<double>(kMaxBoxSeeds, static_cast<double>(fit));
  if (!(count <= most)) {
    return TooLarge("cover_box",
                    Message("cover_box has to place ", Brief(count), " seeds into this box for ",
                            "declared_reach = ", *spec.declared_reach, ", but at most ", most,
                            " may be: give a smaller box, or seeds on each component instead"));
  }
  return Status::Ok();
}

Status CheckProtection(const Specification& spec) {
  const double asked = spec.criteria.protection;
  if (asked == 0) return Status::Ok();
  const auto invalid = [](const std::string& message) {
    return Invalid("criteria.protection", message);
  };
  if (spec.dimension > 3)
    return invalid(Message("criteria.protection is set for dimension ", spec.dimension,
                           ", but only manifolds of dimension 3 and less can be protected: leave "
                           "it out"));
  const double most = spec.dimension <= 2 ? kMaxProtection : kMaxProtectionOfSolids;
  if (!(asked > 0 && asked <= most))
    return invalid(Message("criteria.protection is ", asked, " but in dimension ", spec.dimension,
                           " must be between 0 and ", most,
                           ", a share of epsilon: 0 turns the rule off"));
  if (spec.walls > 0)
    return invalid(
        "criteria.protection is set together with walls, but only closed manifolds can be "
        "protected: leave one of them out");
  if (spec.criteria.size_rate || spec.criteria.max_deviation)
    return invalid(
        "criteria.protection is set together with size_rate or max_deviation, but only meshes of "
        "one size can be protected: leave one of them out");
  return Status::Ok();
}

Status CheckCriteria(const Criteria& c) {
  if (!(c.radius_edge_bound > 1 && c.radius_edge_bound <= kMaxLength)) {
    return Invalid("criteria.radius_edge_bound",
                   Message("criteria.radius_edge_bound (rho0) is ", c.radius_edge_bound,
                           " but must be finite and greater than 1: 2 is the default"));
  }
  if (c.sliver_bound && !(*c.sliver_bound >= 0 && *c.sliver_bound <= kMaxSliverBound)) {
    return Invalid("criteria.sliver_bound",
                   Message("criteria.sliver_bound (Theta0) is ", *c.sliver_bound,
                           " but must be between 0 and ", kMaxSliverBound,
                           ": refinement never ends above; 0 turns the rule off"));
  }
  if (!(c.picking_radius > 0 && c.picking_radius < 1)) {
    return Invalid("criteria.picking_radius",
                   Message("criteria.picking_radius (delta) is ", c.picking_radius,
                           " but must lie strictly between 0 and 1: 0.4 is the default"));
  }
  if (!(c.small_sliver_radius >= 1 && c.small_sliver_radius <= kMaxLength)) {
    return Invalid("criteria.small_sliver_radius",
                   Message("criteria.small_sliver_radius (beta) is ", c.small_sliver_radius,
                           " but must be finite and at least 1: 2 is the default"));
  }
  if (c.candidates && (*c.candidates < 1 || *c.candidates > kMaxCandidates)) {
    return Invalid("criteria.candidates",
                   Message("criteria.candidates is ", *c.candidates, " but must be between 1 and ",
                           kMaxCandidates, ": leave it unset for the default of this dimension"));
  }
  if (c.advance_step && !IsLength(*c.advance_step)) {
    return Invalid("criteria.advance_step",
                   Message("criteria.advance_step (h) is ", *c.advance_step, " but must be ",
                           LengthRule(), ": leave it unset for the default"));
  }
  if (c.size_rate && !(*c.size_rate > 0 && *c.size_rate <= 1)) {
    return Invalid("criteria.size_rate", Message("criteria.size_rate is ", *c.size_rate,
                                                 " but must be in (0, 1]: 0.3 gives a good mesh"));
  }
  if (c.max_deviation && !(*c.max_deviation >= kMinLength && *c.max_deviation <= kMaxLength)) {
    return Invalid("criteria.max_deviation", Message("criteria.max_deviation is ", *c.max_deviation,
                                                     " but must be a positive length"));
  }
  if (c.flat_alternations < 1 || c.flat_alternations > kMaxFlatAlternations) {
    return Invalid(
        "criteria.flat_alternations",
        Message("criteria.flat_alternations is ", c.flat_alternations,
                " but must be between 1 and ", kMaxFlatAlternations, ": 1 is the default"));
  }
  return Status::Ok();
}

Status CheckLimits(const Specification& spec) {
  const Limits& limits = spec.limits;
  if (limits.max_vertices < 1) {
    return Invalid(
        "limits.max_vertices",
        "limits.max_vertices is 0 but must be at least 1: give the largest mesh that you want");
  }
  if (limits.max_vertices > std::numeric_limits<std::uint32_t>::max()) {
    return TooLarge(
        "limits.max_vertices",
        Message("limits.max_vertices is ", limits.max_vertices, " but may be at most ",
                std::numeric_limits<std::uint32_t>::max(), ": vertex ids have 32 bits"));
  }
  if (limits.max_rounds < 1) {
    return Invalid(
        "limits.max_rounds",
        "limits.max_rounds is 0 but must be at least 1: a round is one batch of queries");
  }
  return Status::Ok();
}

}  // namespace

int LargestDimension() { return STELLATE_LARGEST_DIMENSION; }

Status Validate(const Specification& spec) {
  Status status = CheckDimensions(spec);
  if (status.ok()) status = CheckWalls(spec);
  if (status.ok() && spec.boundary_only) status = CheckBoundaryOnly(spec);
  if (status.ok()) status = CheckEpsilon(spec.epsilon);
  if (status.ok() && spec.bounding_box) {
    status = CheckBox(*spec.bounding_box, spec.ambient_dimension);
  }
  if (status.ok()) status = CheckSeeds(spec);
  if (status.ok()) status = CheckReach(spec);
  if (status.ok()) status = CheckCriteria(spec.criteria);
  if (status.ok()) status = CheckProtection(spec);
  if (status.ok()) status = CheckLimits(spec);
  return status;
}

Eigen::MatrixXd CoverOfBox(const Specification& spec) {
  if (!spec.cover_box) return {};
  const BoundingBox& box = *spec.bounding_box;
  const Eigen::VectorXd counts = CoverCounts(spec);
  Eigen::MatrixXd seeds(spec.ambient_dimension, static_cast<Eigen::Index>(counts.prod()));
  Eigen::VectorXd at = Eigen::VectorXd::Zero(spec.ambient_dimension);
  Eigen::ArrayXd off(spec.ambient_dimension);  // another for each axis
  for (Eigen::Index a = 0; a < off.size(); ++a)
    off[a] = kOffMiddle * std::fmod((static_cast<double>(a) + 1) * std::numbers::phi, 1);
  for (Eigen::Index i = 0; i < seeds.cols(); ++i) {
    const Eigen::ArrayXd share = (at.array() + 0.5 + off) / counts.array();
    seeds.col(i) = box.lower.array() + share * (box.upper - box.lower).array();
    for (Eigen::Index a = 0; a < at.size() && ++at[a] == counts[a]; ++a) at[a] = 0;
  }
  return seeds;
}

}  // namespace stellate::core
