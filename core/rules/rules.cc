#include "core/rules/rules.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/base/instantiate.h"
#include "core/base/vector_ops.h"
#include "core/complex/consistency.h"
#include "core/rules/r1_size.h"
#include "core/rules/r2_radius_edge.h"
#include "core/rules/r4_consistency.h"

namespace stellate::core {

namespace {

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
    const bool large = IsTooLarge(simplex.fake, norm2, epsilon);
    if (!large && !simplex.foreign && !HasShortEdge<K>(stars, p, cell, v, edge2, radius_edge_bound))
      continue;
    const Rule rule = large ? Rule::kSize : Rule::kRadiusEdge;
    if (worst && std::tuple(worst->dimension(), worst->rule, -worst->radius) <=
                     std::tuple(dimension, rule, -std::sqrt(norm2)))
      continue;
    worst = ViolationAt<K>(rule, cell, v, simplex.fake);
    worst->walls = simplex.walls;
  }
  return worst;
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
    worst = ViolationAt<K>(rule, cell, v);
    worst->walls = simplex.walls;
  }
  return worst || stage < K ? worst : WorstSharpAngle<K>(stars, p, bounds, size_bound);
}

}  // namespace

template <int K>
std::optional<Violation<K>> WorstSizeOrShape(const Stars<K>& stars, std::uint32_t p, double epsilon,
                                             double radius_edge_bound, int stage, int least) {
  if (stars.sample().walls(p) != 0)
    return WorstSizeOrShapeOnFaces<K>(stars, p, epsilon, radius_edge_bound, stage, least);
  if (stage < K) return std::nullopt;
  if (const auto large = WorstSize<K>(stars, p, epsilon)) return large;
  return WorstRadiusEdge<K>(stars, p, radius_edge_bound);
}

template <int K>
std::optional<Violation<K>> WorstSliverOrInconsistent(const Stars<K>& stars, std::uint32_t p,
                                                      const ShapeBounds& bounds, double size_bound,
                                                      int stage, std::uint64_t consistent,
                                                      int least) {
  if (stars.sample().walls(p) != 0)
    return WorstSliverOrInconsistentOnFaces<K>(stars, p, bounds, size_bound, stage, least);
  if (stage < K) return std::nullopt;
  if (!stars.cell(p).bounded()) return std::nullopt;  // R1 gave up there: nothing to judge yet
  if (const auto sliver = WorstSliver<K>(stars, p, bounds.sliver_bound)) return sliver;
  if (const auto inconsistent = WorstInconsistent<K>(stars, p, consistent)) return inconsistent;
  if (const auto tilted = WorstTilted<K>(stars, p, bounds.reach)) return tilted;
  return WorstSharpAngle<K>(stars, p, bounds, size_bound);
}

#define STELLATE_EACH(K)                                                                        \
  template std::optional<Violation<K>> WorstSizeOrShape(const Stars<K>&, std::uint32_t, double, \
                                                        double, int, int);                      \
  template std::optional<Violation<K>> WorstSliverOrInconsistent(                               \
      const Stars<K>&, std::uint32_t, const ShapeBounds&, double, int, std::uint64_t, int);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
