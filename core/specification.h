#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/status.h"
#include "core/walls.h"

namespace stellate::core {

inline constexpr int kMaxDimension = 5;            // largest k of any build
inline constexpr int kMaxAmbientDimension = 4096;  // largest d; servers may set less
inline constexpr int kDefaultBoxSeeds = 100;       // points drawn from the box when none are given

// Lengths and coordinates beyond these would overflow or vanish when raised to the powers that
// volumes need; every real unit is far inside.
inline constexpr double kMinLength = 1e-45;
inline constexpr double kMaxLength = 1e45;

inline constexpr double kMaxSliverBound = 0.3;  // refinement does not terminate above
inline constexpr int kMaxCandidates = 100;
// Rule R5: more is seldom reached by inserting points.
inline constexpr double kMaxProtection = 0.1, kMaxProtectionOfSolids = 0.05;  // k <= 2, k = 3
inline constexpr int kMaxFlatAlternations = 20;
inline constexpr int kMaxBoxSeeds = 100'000;
inline constexpr int kMaxLabelledWalls = 16;
inline constexpr std::size_t kMaxClosures = 1000;
inline constexpr int kMaxComponents = 1'000'000;                   // that may be declared
inline constexpr std::int64_t kMaxBoxSeedCoordinates = 4'000'000;  // box_seeds times d

// What the client's oracle can do beyond closest_point, which it must have (Sec. 5.3.1).
struct OracleCapabilities {
  bool intersect_flat = false;  // answers "the point of M nearest c in c + T^perp"
  bool tangent_basis = false;   // sends an orthonormal tangent basis with every point of M
  bool local_size = false;      // sends a local size with every point of M: see size_rate
  bool conormals = false;       // sends the walls' conormals with points of faces
};

// Axis-aligned box, ambient coordinates, lower < upper in each.
struct BoundingBox {
  Eigen::VectorXd lower, upper;  // d each
};

// The centre at which a simplex of a star is tested against a new point.
enum class CentreRule {
  kTangentSpace,  // in each vertex's tangent space alone, as the thesis has it
  kCommonCentre,  // at one centre for all its vertices (core/geometry/common_centre.h)
};

// The constants of Chapter 5. The proofs' values are far too small to use; these defaults were
// chosen by measurement. nullopt: the default for this k.
struct Criteria {
  double radius_edge_bound = 2.0;         // rho0 of rule R2, no unit, > 1
  std::optional<double> sliver_bound;     // Theta0 of rule R3, no unit, in [0, 0.3]; 0 turns R3
                                          // off. Default 0 for k <= 2; 0.25, 0.15, 0.1 for
                                          // k = 3, 4, 5; 0.2 for k = 3 with walls
  double picking_radius = 0.4;            // delta: the picking region is B(c_p, delta R_p); in
                                          // (0, 1)
  double small_sliver_radius = 2.0;       // beta: only simplices of circumradius <= beta R_p
                                          // count against a candidate; >= 1
  std::optional<int> candidates;          // points tried in a picking region, 1..100. Default 1
                                          // for k <= 2, 10 for k >= 3, 40 there
                                          // where sliver_bound is above 0.25
  std::optional<double> advance_step;     // h, length: how far the front steps over unknown
                                          // ground. Default 3 epsilon, or a tenth of the
                                          // bounding box's diagonal if that is more
  std::optional<CentreRule> centre_rule;  // default kTangentSpace for k <= 2 and for graded sizes,
                                          // else kCommonCentre
  bool speculative = false;               // sample and refine on a surrogate of M first, then
                                          // query all those points in one batch: a handful of
                                          // round trips for up to three times the processor time
  // Graded sizes: where the mesh must be finer than epsilon, which stays the upper bound. Both
  // criteria use size(p), p a vertex:
  // - with OracleCapabilities::local_size, the client's value at p: its local feature size or any
  //   other positive length, taken as it is. Nothing is assumed of the field between vertices: a
  //   dip between vertices is missed; a 1-Lipschitz field has none if the rate is below 1. Never
  //   finer than epsilon / 1024; a field that asks for more is a warning.
  // - else the local feature size that the sample shows: the smallest |q - p|^2 / (2 dist(q, T_pM))
  //   over a star, made 1-Lipschitz over neighbours. It detects curvature, but no second sheet
  //   nearby, and is never finer than epsilon / 64, since noise in the answers looks like
  //   curvature.
  std::optional<double> size_rate;      // R_p <= size_rate * size(p), no unit, in (0, 1]
  std::optional<double> max_deviation;  // the Hausdorff target, a length, > 0: R_p^2 / (2
                                        // size(p)), the circumcentre's distance to M, stays
                                        // below it
  int flat_alternations = 1;            // without intersect_flat: closest points taken when
                                        // alternating towards a flat, 1..20
  // Rule R5: no other sample point is nearer to the centre of a simplex than its circumradius and
  // this share of epsilon; in [0, 0.1] for k <= 2, in [0, 0.05] for k = 3. 0: no such rule. A mesh
  // where that is not reached is what it is, and its certificate says so. Closed manifolds of one
  // size only.
  double protection = 0;
};

// How much a certificate asks of the oracle.
enum class Audit {
  kStandard,  // a few thousand queries, for a mesh of any size
  kThorough,  // about every vertex and every simplex
};

// Where a run ends that does not end by itself: the mesh is then kept as it is, uncertified.
struct Limits {
  std::uint64_t max_vertices = 10'000'000;
  std::uint64_t max_rounds = 100'000;   // batches of queries
  std::uint64_t max_batch_queries = 0;  // a larger round is asked in several batches, and each
                                        // counts as one of max_rounds. The same mesh, unless it
                                        // ends by them. 0: no limit
};

// All that determines a mesh besides the answers. How it is computed is in core/execution.h.
//
//   Specification spec;
//   spec.dimension = 2, spec.ambient_dimension = 3, spec.epsilon = 0.1;
//   spec.seeds = points_near_m;  // 3 x m
//   spec.criteria.max_deviation = 1e-3;  // finer where M bends
//   if (const Status status = Validate(spec); !status.ok()) std::cerr << status.message << '\n';
//
// Lengths and coordinates are in one unit of the caller's choice. Set the two dimensions, epsilon,
// and seeds or a box; all else has a default.
struct Specification {
  int dimension = 0;          // k
  int ambient_dimension = 0;  // d, k < d
  int walls = 0;              // of a manifold with boundary: see core/walls.h; k <= d then
  // An arrangement of walls: the label, 0 to 127, of each of the 2^walls sign vectors, in whose
  // number bit i is set where g_i >= 0; -1 where no point has these signs. M is where the label is
  // not 0; its regions, one for each label, are meshed together. Empty: M is where all g_i >= 0.
  std::vector<std::int8_t> labels;
  // Of an arrangement whose walls depend on each other, as those of three phases that meet do: sets
  // of three walls or more. Each wall of a set is zero wherever all others of it are. A face is
  // then queried with all walls that are zero there.
  std::vector<WallSet> closures;
  // Mesh the boundary of M alone, and what is between regions, without the inside: the simplices
  // have the dimension k - 1. Needs walls and k >= 2.
  bool boundary_only = false;
  double epsilon = 0;  // rule R1: every R_p(sigma) <= epsilon; a length, > 0
  OracleCapabilities oracle;
  std::optional<BoundingBox> bounding_box;  // seeds are drawn from it when none are given
  Eigen::MatrixXd seeds;                    // d x m, near M, may be empty
  int box_seeds = 0;                        // points drawn from the box; 0: the default
  int components = 0;  // M has at least these; a mesh with fewer is refused. 0: not known
  // The client promises that M's reach is at least this, a length: the mesh is refined until that
  // promise and the mesh prove its topology (core/certificate/claims/proof.h), or refute the
  // promise.
  std::optional<double> declared_reach;
  // Cover the box with seeds so densely that every component of M in it is found (CoverOfBox).
  // Needs the box and the declared reach, and no seeds.
  bool cover_box = false;
  std::uint64_t random_seed = 1;  // of everything random
  Criteria criteria;
  Audit audit = Audit::kStandard;
  Limits limits;

  int simplex_dimension() const { return dimension - (boundary_only ? 1 : 0); }
  // How many labels each simplex has: none, that of its region, or those of both its sides.
  int labels_per_simplex() const { return boundary_only ? 2 : labels.empty() ? 0 : 1; }
};

// Returns the seeds that cover the box, d x n: each point of the box is nearer than the declared
// reach to a seed. For a point of M in the box, that seed's closest point lies on the same
// component of M. No columns if `cover_box` is not set.
Eigen::MatrixXd CoverOfBox(const Specification& spec);

// Returns kInvalidArgument or kLimitExceeded with the offending field and value, else Ok.
Status Validate(const Specification& spec);

// The largest k that this build meshes: kMaxDimension, or 3 without STELLATE_HIGH_DIMENSIONS.
int LargestDimension();

}  // namespace stellate::core
