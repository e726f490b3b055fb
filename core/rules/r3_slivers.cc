#include "core/rules/r3_slivers.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <bit>
#include <type_traits>
#include <utility>

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

// Returns the simplex of star(p) with the largest circumradius that is bad and has its lowest
// vertex at p.
template <int K, class IsBad>
std::optional<std::size_t> LargestBad(const Stars<K>& stars, std::uint32_t p, const IsBad& is_bad) {
  const auto& cell = stars.cell(p);
  WorstVertex<K> worst(cell);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (worst.IsBeatenBy(v, cell.norm2(v)) && IsLowest<K>(p, cell, v) && is_bad(v))
      worst.Take(v, cell.norm2(v));
  return worst.is_any() ? std::optional(worst.vertex()) : std::nullopt;
}

}  // namespace

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

template <int K>
std::optional<Violation<K>> WorstSliver(const Stars<K>& stars, std::uint32_t p,
                                        double sliver_bound) {
  if (sliver_bound <= 0) return std::nullopt;
  const auto& cell = stars.cell(p);
  const auto worst = LargestBad<K>(stars, p, [&](std::size_t v) {
    return !stars.TouchesProtectingBall(p, cell, v) &&
           HasThinFaceAt<K>(stars, stars.sample().Point(p), cell, v, sliver_bound, nullptr);
  });
  if (!worst) return std::nullopt;
  return ViolationAt<K>(Rule::kShape, cell, *worst);
}

template <int K>
std::optional<Violation<K>> WorstTilted(const Stars<K>& stars, std::uint32_t p, double reach) {
  if (!std::isfinite(reach)) return std::nullopt;
  const auto& cell = stars.cell(p);
  const auto worst = LargestBad<K>(stars, p, [&](std::size_t v) {
    return TiltsTooFar<K>(stars, p, stars.sample().Point(p), cell, v, reach, nullptr);
  });
  if (!worst) return std::nullopt;
  Violation<K> violation = ViolationAt<K>(Rule::kShape, cell, *worst);
  violation.tilted = true;
  return violation;
}

template <int K>
std::optional<Violation<K>> WorstSharpAngle(const Stars<K>& stars, std::uint32_t p,
                                            const ShapeBounds& bounds, double size_bound) {
  if (bounds.sharpest_cosine >= 1) return std::nullopt;
  std::optional<Violation<K>> largest;
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
    const auto worst =
        WorstSharp<K>(stars, p, bounds.sharpest_cosine, bounds.sharp_radius * size_bound, sector);
    if (!worst) continue;
    const Violation<K> violation =
        ViolationAt<K>(Rule::kShape, stars.cell(p, sector), *worst, false, sector);
    if (largest && largest->radius >= violation.radius) continue;
    largest = violation;
    largest->sharp = true;
  }
  return largest;
}

#define STELLATE_EACH(K)                                                                          \
  template bool HasThinFaceAt(const Stars<K>&, const double*, const RestrictedVoronoiCell<K>&,    \
                              std::size_t, double, const double*);                                \
  template bool TiltsTooFar(const Stars<K>&, std::uint32_t, const double*,                        \
                            const RestrictedVoronoiCell<K>&, std::size_t, double, const double*); \
  template bool IsFlatOnWall(const Stars<K>&, std::uint32_t, const RestrictedVoronoiCell<K>&,     \
                             std::size_t);                                                        \
  template std::optional<Violation<K>> WorstSliver(const Stars<K>&, std::uint32_t, double);       \
  template std::optional<Violation<K>> WorstTilted(const Stars<K>&, std::uint32_t, double);       \
  template std::optional<Violation<K>> WorstSharpAngle(const Stars<K>&, std::uint32_t,            \
                                                       const ShapeBounds&, double);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
