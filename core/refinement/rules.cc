#include "core/refinement/rules.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/dense.h"
#include "core/base/instantiate.h"
#include "core/boundary/sharp_dihedrals.h"
#include "core/geometry/reach.h"
#include "core/geometry/simplex_frame.h"

namespace stellate::core {
namespace {

// Simplices must be tilted 0.05 radians less than a proof allows: more than the error of tangents
// found by differences if epsilon is half of the reach.
constexpr double kCosineOfTiltMargin = 0.99875026039496623,
                 kSineOfTiltMargin = 0.049979169270678331;
// A volume below this share of the product of its edges' lengths belongs to points that an oracle's
// error alone takes off a flat wall.
constexpr double kFlatEdges = 1e-8;
// Below this dimension such simplices were not seen to stay.
constexpr int kFirstFlat = 4;

template <int K>
Violation<K> AtVertex(Rule rule, const RestrictedVoronoiCell<K>& cell, std::size_t v, bool fake) {
  Violation<K> violation;
  violation.vertex = v;
  violation.rule = rule;
  violation.radius = std::sqrt(cell.norm2(v));
  std::copy_n(cell.x(v), K, violation.x);
  violation.fake = fake;
  return violation;
}

// Whether, of two vertices of p's cell that are equally bad, v's simplex has the lower ids. The
// order of a cell's vertices depends on the order of its cuts.
template <int K>
bool Precedes(const RestrictedVoronoiCell<K>& cell, std::size_t v, std::size_t w) {
  const auto ids_of = [&](std::size_t at) {
    std::array<std::uint32_t, K> ids;
    for (int s = 0; s < K; ++s) ids[static_cast<std::size_t>(s)] = cell.id(cell.facet(at, s));
    std::sort(ids.begin(), ids.end());
    return ids;
  };
  return ids_of(v) < ids_of(w);
}

// Whether v is worse than the worst so far, by the measure of each.
template <int K>
bool IsWorse(const RestrictedVoronoiCell<K>& cell, std::size_t v, double badness,
             const std::optional<std::size_t>& worst, double worst_badness) {
  if (!worst || badness != worst_badness) return !worst || badness > worst_badness;
  return Precedes<K>(cell, v, *worst);
}

// Determinant of a symmetric J x J matrix, by elimination.
template <int J>
double GramDeterminant(double (&g)[J][J]) {
  double det = 1;
  for (int c = 0; c < J; ++c) {
    det *= g[c][c];
    if (!(g[c][c] > 0)) return 0;
    for (int r = c + 1; r < J; ++r) {
      const double factor = g[r][c] / g[c][c];
      for (int i = c + 1; i < J; ++i) g[r][i] -= factor * g[c][i];
    }
  }
  return det;
}

// The edges of a k-simplex from its vertex p to the others.
template <int K>
struct SimplexEdges {
  double length2[K];
  double between2[K][K];  // below the diagonal, of the edges between their ends
  double gram[K][K];
};

// Whether the face on p and the vertices in `face`, a bit each, two at least, is a sliver.
template <int K, unsigned face>
bool IsThin(const SimplexEdges<K>& edges, double sliver_bound) {
  constexpr int j = std::popcount(face);
  constexpr auto at = [] {
    std::array<int, j> ends{};
    for (int a = 0, n = 0; a < K; ++a)
      if (face >> a & 1u) ends[static_cast<std::size_t>(n++)] = a;
    return ends;
  }();
  double diameter2 = 0;
  double g[j][j];
  for (std::size_t r = 0; r < j; ++r) {
    diameter2 = std::max(diameter2, edges.length2[at[r]]);
    for (std::size_t c = 0; c < r; ++c)
      diameter2 = std::max(diameter2, edges.between2[at[r]][at[c]]);
    for (std::size_t c = 0; c < j; ++c) g[r][c] = edges.gram[at[r]][at[c]];
  }
  const double bound = sliver_bound * sliver_bound;
  double factorial = 1, bound2j = 1, diameter2j = 1;
  for (int i = 1; i <= j; ++i) {
    factorial *= i;
    bound2j *= bound;
    diameter2j *= diameter2;
  }
  // Theta = vol / diameter^j < Theta0^j, squared.
  return GramDeterminant<j>(g) < bound2j * diameter2j * factorial * factorial;
}

template <int K>
bool HasThinFace(const SimplexEdges<K>& edges, double sliver_bound) {
  const auto is_thin = [&](auto face) {
    if constexpr (std::popcount(face()) < 2)
      return false;
    else
      return IsThin<K, face()>(edges, sliver_bound);
  };
  return [&]<unsigned... face>(std::integer_sequence<unsigned, face...>) {
    return (is_thin(std::integral_constant<unsigned, face>()) || ...);
  }
  (std::make_integer_sequence<unsigned, 1u << K>());
}

// Tests a star at the boundary, whose cell's vertices are dual to simplices of several faces.
template <int K>
std::optional<Violation<K>> WorstSizeOrShapeOnFaces(const Stars<K>& stars, std::uint32_t p,
                                                    double epsilon, double radius_edge_bound,
                                                    int stage, int least) {
  const auto& cell = stars.cell(p);
  std::optional<Violation<K>> worst;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const auto simplex = stars.FaceSimplexOf(p, cell, v);
    const int dimension = simplex.dimension();
    if (dimension < least || dimension > stage) continue;
    const double norm2 = cell.norm2(v);
    double edge2 = INFINITY;
    for (int i = 0; i < simplex.count; ++i) {
      const std::uint32_t q = simplex.ids[static_cast<std::size_t>(i)];
      if (q != p)
        edge2 = std::min(edge2, SquaredDistance(stars.sample().Point(p), stars.sample().Point(q),
                                                stars.sample().d()));
    }
    const bool large = simplex.fake || norm2 > epsilon * epsilon;
    const bool long_enough = norm2 <= radius_edge_bound * radius_edge_bound * edge2 ||
                             stars.TouchesProtectingBall(p, cell, v);
    if (!large && !simplex.foreign && long_enough) continue;
    const Rule rule = large ? Rule::kSize : Rule::kRadiusEdge;
    if (worst && std::tuple(worst->dimension(), worst->rule, -worst->radius) <=
                     std::tuple(dimension, rule, -std::sqrt(norm2)))
      continue;
    worst = AtVertex<K>(rule, cell, v, simplex.fake);
    worst->walls = simplex.walls;
  }
  return worst;
}

}  // namespace

template <int K>
std::optional<Violation<K>> WorstSizeOrShape(const Stars<K>& stars, std::uint32_t p, double epsilon,
                                             double radius_edge_bound, int stage, int least) {
  if (stars.sample().walls(p) != 0)
    return WorstSizeOrShapeOnFaces<K>(stars, p, epsilon, radius_edge_bound, stage, least);
  if (stage < K) return std::nullopt;
  const auto& cell = stars.cell(p);
  std::optional<std::size_t> worst;
  double worst_norm2 = 0;
  if (!cell.bounded() || cell.max_norm2() > epsilon * epsilon) {
    bool worst_fake = false;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const bool fake = !cell.bounded() && cell.HasFakeFacet(v);
      const double norm2 = cell.norm2(v);
      if (!(fake || norm2 > epsilon * epsilon) || !IsWorse<K>(cell, v, norm2, worst, worst_norm2))
        continue;
      worst = v;
      worst_norm2 = norm2;
      worst_fake = fake;
    }
    if (worst) return AtVertex<K>(Rule::kSize, cell, *worst, worst_fake);
  }
  thread_local std::vector<double> edges2;
  edges2.clear();
  for (std::size_t f = 0; f < cell.facet_count(); ++f) edges2.push_back(stars.EdgeLength2(p, f));
  const double bound2 = radius_edge_bound * radius_edge_bound;
  double worst_rho2 = 0;
  // Mostly the longest radius is short enough for the shortest edge.
  if (cell.max_norm2() <= bound2 * *std::min_element(edges2.begin(), edges2.end()))
    return std::nullopt;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    double edge2 = INFINITY;
    for (int s = 0; s < K; ++s) edge2 = std::min(edge2, edges2[cell.facet(v, s)]);
    const double norm2 = cell.norm2(v);
    const double rho2 = norm2 / edge2;
    if (!(rho2 > bound2) || !IsWorse<K>(cell, v, rho2, worst, worst_rho2)) continue;
    if (stars.TouchesProtectingBall(p, cell, v)) continue;
    worst_rho2 = rho2;
    worst = v;
  }
  if (worst) return AtVertex<K>(Rule::kRadiusEdge, cell, *worst, false);
  return std::nullopt;
}

template <int K>
bool HasThinFaceAt(const Stars<K>& stars, const double* p, const RestrictedVoronoiCell<K>& cell,
                   std::size_t v, double sliver_bound, const double* unborn) {
  if (K < 2 || sliver_bound <= 0) return false;
  const int d = stars.sample().d();
  const double* q[K];
  for (int a = 0; a < K; ++a) {
    const std::uint32_t id = cell.id(cell.facet(v, a));
    q[a] = id < stars.size() ? stars.sample().Point(id) : unborn;
  }
  SimplexEdges<K> edges;
  WithDimension(d, [&](auto known) {
    const int n = known() > 0 ? known() : d;
    for (int a = 0; a < K; ++a) {
      edges.length2[a] = edges.gram[a][a] = SquaredDistance(p, q[a], n);
      for (int b = 0; b < a; ++b) edges.between2[a][b] = SquaredDistance(q[a], q[b], n);
    }
  });
  for (int a = 0; a < K; ++a)
    for (int b = 0; b < a; ++b)
      edges.gram[a][b] = edges.gram[b][a] =
          0.5 * (edges.length2[a] + edges.length2[b] - edges.between2[a][b]);
  return HasThinFace<K>(edges, sliver_bound);
}

template <int K>
bool TiltsTooFar(const Stars<K>& stars, std::uint32_t p, const double* at,
                 const RestrictedVoronoiCell<K>& cell, std::size_t v, double reach,
                 const double* unborn) {
  if (!std::isfinite(reach)) return false;
  const int d = stars.sample().d();
  std::array<const double*, K + 1> corners;
  std::array<std::uint32_t, K + 1> ids;
  corners[0] = at;
  ids[0] = p;
  double diameter2 = 0;
  for (int a = 0; a < K; ++a) {
    ids[a + 1] = cell.id(cell.facet(v, a));
    corners[a + 1] = ids[a + 1] < stars.size() ? stars.sample().Point(ids[a + 1]) : unborn;
    for (int b = 0; b <= a; ++b)
      diameter2 = std::max(diameter2, SquaredDistance(corners[a + 1], corners[b], d));
  }
  // A proof's right angle, less how far M turns, less the margin: its sine.
  const double half = SineOfHalfTurn(JungRatio(K) * std::sqrt(diameter2), reach);
  if (!(half < 1)) return true;
  const double sine = kCosineOfTiltMargin * (1 - 2 * half * half) -
                      kSineOfTiltMargin * 2 * half * std::sqrt(1 - half * half);
  if (sine <= 0) return true;
  thread_local SimplexFrame frame;
  frame.directions.resize(static_cast<std::size_t>(d) * K);
  TakeFrame({corners.data(), corners.size()}, K, d, frame);
  if (frame.rank < K) return true;
  for (const std::uint32_t id : ids) {
    if (id >= stars.size()) continue;
    // The sum is no less than the largest: mostly that is enough to know.
    if (SumOfSquaredSines(frame, K, d, stars.sample().Tangent(id), K) < sine * sine) continue;
    if (SineToTangent(frame, K, d, stars.sample().Tangent(id), K) >= sine) return true;
  }
  return false;
}

namespace {

// Whether the simplex on p and the facets of v has all its vertices on one wall and no volume in
// p's tangent space. Stars may agree on such a simplex if the wall's own simplices and those inside
// split cospherical points of a flat wall differently.
template <int K>
bool IsFlatOnWall(const Stars<K>& stars, std::uint32_t p, const RestrictedVoronoiCell<K>& cell,
                  std::size_t v) {
  if (K < kFirstFlat) return false;
  WallSet common = stars.sample().walls(p);
  Eigen::Matrix<double, K, K> edges;
  for (int a = 0; a < K; ++a) {
    const std::uint32_t id = cell.id(cell.facet(v, a));
    common &= stars.sample().walls(id);
    if (common == 0) return false;
    stars.sample().Project(p, stars.sample().Point(id), edges.col(a).data());
  }
  return std::abs(Determinant<K>(edges)) <= kFlatEdges * edges.colwise().norm().prod();
}

// Tests a closed star that breaks no other rule.
template <int K>
std::optional<Violation<K>> SharpSimplex(const Stars<K>& stars, std::uint32_t p,
                                         const ShapeBounds& bounds, double size_bound) {
  if (bounds.sharpest_cosine >= 1) return std::nullopt;
  const auto worst =
      WorstSharp<K>(stars, p, bounds.sharpest_cosine, bounds.sharp_radius * size_bound);
  if (!worst) return std::nullopt;
  Violation<K> violation = AtVertex<K>(Rule::kShape, stars.cell(p), *worst, false);
  violation.sharp = true;
  return violation;
}

template <int K>
std::optional<Violation<K>> WorstSliverOrInconsistentOnFaces(const Stars<K>& stars, std::uint32_t p,
                                                             const ShapeBounds& bounds,
                                                             double size_bound, int stage,
                                                             int least) {
  const auto& cell = stars.cell(p);
  std::optional<Folds<K>> folds;
  if (stars.centre_rule() == CentreRule::kCommonCentre) folds.emplace(stars, p);
  std::optional<Violation<K>> worst;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const auto simplex = stars.FaceSimplexOf(p, cell, v);
    const int dimension = simplex.dimension();
    if (dimension < least || dimension > stage) continue;
    if (simplex.fake) return std::nullopt;  // R1 gave up there: nothing to judge yet
    const bool whole = dimension == K, held = simplex.ids[0] == p;
    const bool thin =
        whole && held && bounds.sliver_bound > 0 && !stars.TouchesProtectingBall(p, cell, v) &&
        (HasThinFaceAt<K>(stars, stars.sample().Point(p), cell, v, bounds.sliver_bound, nullptr) ||
         IsFlatOnWall<K>(stars, p, cell, v));
    if (!thin && IsConsistent<K>(stars, p, v) && !(whole && folds && folds->IsFolded(v))) continue;
    const Rule rule = thin ? Rule::kShape : Rule::kInconsistent;
    if (worst && std::tuple(worst->dimension(), worst->rule, -worst->radius) <=
                     std::tuple(dimension, rule, -std::sqrt(cell.norm2(v))))
      continue;
    worst = AtVertex<K>(rule, cell, v, false);
    worst->walls = simplex.walls;
  }
  return worst || stage < K ? worst : SharpSimplex<K>(stars, p, bounds, size_bound);
}

}  // namespace

template <int K>
std::optional<Violation<K>> WorstSliverOrInconsistent(const Stars<K>& stars, std::uint32_t p,
                                                      const ShapeBounds& bounds, double size_bound,
                                                      int stage, std::uint64_t consistent,
                                                      int least) {
  if (stars.sample().walls(p) != 0)
    return WorstSliverOrInconsistentOnFaces<K>(stars, p, bounds, size_bound, stage, least);
  if (stage < K) return std::nullopt;
  const auto& cell = stars.cell(p);
  if (!cell.bounded()) return std::nullopt;  // R1 gave up there: nothing to judge yet
  std::optional<std::size_t> worst;
  const auto is_worse = [&](std::size_t v) {
    return IsWorse<K>(cell, v, cell.norm2(v), worst, worst ? cell.norm2(*worst) : 0);
  };
  // Tests a simplex in the star of its lowest vertex: if it is not there, it is inconsistent
  // anyway.
  const auto held = [&](std::size_t v) {
    for (int s = 0; s < K; ++s)
      if (cell.id(cell.facet(v, s)) < p) return false;
    return true;
  };
  if (bounds.sliver_bound > 0) {
    for (std::size_t v = 0; v < cell.vertex_count(); ++v)
      if (is_worse(v) && held(v) && !stars.TouchesProtectingBall(p, cell, v) &&
          HasThinFaceAt<K>(stars, stars.sample().Point(p), cell, v, bounds.sliver_bound, nullptr))
        worst = v;
    if (worst) return AtVertex<K>(Rule::kShape, cell, *worst, false);
  }
  const auto is_consistent = [&](std::size_t v) {
    return (v < 64 && (consistent >> v & 1) != 0) || IsConsistent<K>(stars, p, v);
  };
  std::optional<Folds<K>> folds;
  if (stars.centre_rule() == CentreRule::kCommonCentre) folds.emplace(stars, p);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (is_worse(v) && (!is_consistent(v) || (folds && folds->IsFolded(v)))) worst = v;
  if (worst) return AtVertex<K>(Rule::kInconsistent, cell, *worst, false);
  if (!std::isfinite(bounds.reach)) return SharpSimplex<K>(stars, p, bounds, size_bound);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (is_worse(v) && held(v) &&
        TiltsTooFar<K>(stars, p, stars.sample().Point(p), cell, v, bounds.reach, nullptr))
      worst = v;
  if (!worst) return SharpSimplex<K>(stars, p, bounds, size_bound);
  Violation<K> violation = AtVertex<K>(Rule::kShape, cell, *worst, false);
  violation.tilted = true;
  return violation;
}

#define STELLATE_EACH(K)                                                                        \
  template std::optional<Violation<K>> WorstSizeOrShape(const Stars<K>&, std::uint32_t, double, \
                                                        double, int, int);                      \
  template std::optional<Violation<K>> WorstSliverOrInconsistent(                               \
      const Stars<K>&, std::uint32_t, const ShapeBounds&, double, int, std::uint64_t, int);     \
  template bool HasThinFaceAt(const Stars<K>&, const double*, const RestrictedVoronoiCell<K>&,  \
                              std::size_t, double, const double*);                              \
  template bool TiltsTooFar(const Stars<K>&, std::uint32_t, const double*,                      \
                            const RestrictedVoronoiCell<K>&, std::size_t, double, const double*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
