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

// Keeps the worst of the violations that it is offered: of the lowest dimension, then of the first
// rule, then of the largest radius.
template <int K>
class Worst {
 public:
  void Offer(Rule rule, const RestrictedVoronoiCell<K>& cell, std::size_t v,
             const typename Stars<K>::FaceSimplex& simplex, int sector) {
    const double radius = std::sqrt(cell.norm2(v));
    if (worst_ && std::tuple(worst_->dimension(), worst_->rule, -worst_->radius) <=
                      std::tuple(simplex.dimension(), rule, -radius))
      return;
    worst_ = ViolationAt<K>(rule, cell, v, simplex.fake, sector);
    worst_->walls = simplex.walls;
    worst_->codimension = simplex.codimension;
  }
  const std::optional<Violation<K>>& worst() const { return worst_; }

 private:
  std::optional<Violation<K>> worst_;
};

// Calls visit(v, simplex) for the simplices of a sector of star(p) that are of these dimensions and
// on live faces, until it returns false.
template <int K, typename Visit>
bool VisitFaces(const Stars<K>& stars, std::uint32_t p, int sector, int least, int most,
                const Visit& visit) {
  const auto& cell = stars.cell(p, sector);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const auto simplex = stars.FaceSimplexOf(p, cell, v);
    if (simplex.dimension() < least || simplex.dimension() > most ||
        stars.sample().sectors().Piece(p, sector, simplex.walls) == 0)
      continue;
    if (!visit(v, simplex)) return false;
  }
  return true;
}

// Returns the squared length of the shortest edge at p of a simplex.
template <int K>
double ShortestEdge2(const Stars<K>& stars, std::uint32_t p,
                     const typename Stars<K>::FaceSimplex& simplex) {
  double edge2 = INFINITY;
  for (int i = 0; i < simplex.count; ++i) {
    const std::uint32_t q = simplex.ids[static_cast<std::size_t>(i)];
    if (q != p)
      edge2 = std::min(edge2, SquaredDistance(stars.sample().Point(p), stars.sample().Point(q),
                                              stars.sample().d()));
  }
  return edge2;
}

// Whether a simplex is an edge between two protecting balls, which nothing splits any more. Where
// sizes are estimated, a later estimate may find it too long: its star would break R1 without end,
// and nothing else in it would be fixed.
template <int K>
bool IsEdgeOfBalls(const Stars<K>& stars, const typename Stars<K>::FaceSimplex& simplex) {
  return stars.sample().has_protecting_balls() && simplex.dimension() == 1 && !simplex.fake &&
         simplex.count == 2 && stars.sample().ProtectingRadius2(simplex.ids[0]) > 0 &&
         stars.sample().ProtectingRadius2(simplex.ids[1]) > 0;
}

// Tests a star at the boundary, whose cells' vertices are dual to simplices of several faces.
template <int K>
std::optional<Violation<K>> WorstSizeOrShapeOnFaces(const Stars<K>& stars, std::uint32_t p,
                                                    double epsilon, double radius_edge_bound,
                                                    int stage, int least) {
  Worst<K> worst;
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
    const auto& cell = stars.cell(p, sector);
    VisitFaces<K>(stars, p, sector, least, stage, [&](std::size_t v, const auto& simplex) {
      const double edge2 = ShortestEdge2<K>(stars, p, simplex);
      const bool large =
          IsTooLarge(simplex.fake, cell.norm2(v), epsilon) && !IsEdgeOfBalls<K>(stars, simplex);
      if (large || simplex.foreign || HasShortEdge<K>(stars, p, cell, v, edge2, radius_edge_bound))
        worst.Offer(large ? Rule::kSize : Rule::kRadiusEdge, cell, v, simplex, sector);
      return true;
    });
  }
  return worst.worst();
}

template <int K>
std::optional<Violation<K>> WorstSliverOrInconsistentOnFaces(const Stars<K>& stars, std::uint32_t p,
                                                             const ShapeBounds& bounds,
                                                             double size_bound, int stage,
                                                             int least) {
  Worst<K> worst;
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
    const auto& cell = stars.cell(p, sector);
    std::optional<Folds<K>> folds;
    if (stars.centre_rule() == CentreRule::kCommonCentre) folds.emplace(stars, p, sector);
    const auto judge = [&](std::size_t v, const auto& simplex) {
      if (simplex.fake) return false;  // R1 gave up there: nothing to judge yet
      const bool whole = simplex.dimension() == K, held = simplex.ids[0] == p;
      const bool thin = whole && held && bounds.sliver_bound > 0 &&
                        !stars.TouchesProtectingBall(p, cell, v) &&
                        (HasThinFaceAt<K>(stars, stars.sample().Point(p), cell, v,
                                          bounds.sliver_bound, nullptr) ||
                         IsFlatOnWall<K>(stars, p, cell, v));
      if (thin || !IsConsistent<K>(stars, p, v, sector) || (whole && folds && folds->IsFolded(v)))
        worst.Offer(thin ? Rule::kShape : Rule::kInconsistent, cell, v, simplex, sector);
      return true;
    };
    if (!VisitFaces<K>(stars, p, sector, least, stage, judge)) return std::nullopt;
  }
  return worst.worst() || stage < K ? worst.worst()
                                    : WorstSharpAngle<K>(stars, p, bounds, size_bound);
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
