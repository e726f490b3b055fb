#include "core/refinement/face_splits.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// On a curved edge the radius of a shell may be a little larger than it was set.
constexpr double kShellLength = 1.1;

}  // namespace

template <int K>
bool FaceSplits<K>::IsOnShell(const typename Stars<K>::FaceSimplex& simplex) const {
  if (simplex.count != 2) return false;
  const double length =
      Distance(engine_.stars.sample().Point(simplex.ids[0]),
               engine_.stars.sample().Point(simplex.ids[1]), engine_.stars.sample().d());
  return length <= kShellLength * std::max(engine_.boundary.ShellOf(simplex.ids[0]),
                                           engine_.boundary.ShellOf(simplex.ids[1]));
}

template <int K>
bool FaceSplits<K>::IsSliverAtBoundary(std::uint32_t star, const Violation<K>& violation) const {
  if (violation.rule != Rule::kShape || engine_.stars.sample().boundary().empty()) return false;
  const auto simplex = engine_.stars.FaceSimplexOf(star, engine_.stars.cell(star, violation.sector),
                                                   violation.vertex);
  return std::any_of(simplex.ids.begin(), simplex.ids.begin() + simplex.count,
                     [&](std::uint32_t id) { return engine_.stars.sample().walls(id) != 0; });
}

template <int K>
std::optional<Target<K>> FaceSplits<K>::Of(const typename Stars<K>::CellVertex& at, Rule by) const {
  const auto& cell = engine_.stars.cell(at.star, at.sector);
  Violation<K> violation =
      ViolationAt<K>(std::min(by, Rule::kRadiusEdge), cell, at.vertex, false, at.sector);
  const auto simplex = engine_.stars.FaceSimplexOf(at.star, cell, at.vertex);
  violation.walls = simplex.walls;
  violation.codimension = simplex.codimension;
  violation.encroached = true;
  if (IsOnShell(simplex)) return std::nullopt;
  if (violation.dimension() <= engine_.boundary.left()) return std::nullopt;
  // The middle of an edge between two protecting balls is in both.
  if (simplex.count == 2 && engine_.stars.sample().ProtectingRadius2(simplex.ids[0]) > 0 &&
      engine_.stars.sample().ProtectingRadius2(simplex.ids[1]) > 0)
    return std::nullopt;
  if (by > Rule::kSize &&
      violation.radius < kLeastSplit * engine_.sizes.BoundAt(engine_.stars, at.star))
    return std::nullopt;
  return TargetFor<K>(at.star, violation, engine_.sizes.BoundAt(engine_.stars, at.star),
                      engine_.criteria.advance_step, engine_.violations.failed_attempts(at.star));
}

template <int K>
std::optional<Target<K>> FaceSplits<K>::Under(std::uint32_t star,
                                              const Violation<K>& violation) const {
  if (violation.rule != Rule::kShape || violation.walls != 0 ||
      engine_.violations.failed_attempts(star) == 0)
    return std::nullopt;
  const auto& cell = engine_.stars.cell(star, violation.sector);
  WallSet common = engine_.stars.sample().walls(star);
  for (int s = 0; s < K; ++s)
    common &= engine_.stars.sample().walls(cell.id(cell.facet(violation.vertex, s)));
  if (common == 0) return std::nullopt;
  for (int s = 0; s < K; ++s) {
    const std::size_t below = cell.adjacent(violation.vertex, s);
    const WallSet walls = WallsAt<K>(cell, below);
    if (CountWalls(walls) == 1 && !cell.HasFakeFacet(below) &&
        engine_.stars.sample().sectors().Piece(star, violation.sector, walls) != 0)
      return Of({star, below, violation.sector}, Rule::kShape);
  }
  return std::nullopt;
}

template <int K>
void FaceSplits<K>::Yield(std::vector<Target<K>>* targets) {
  if (engine_.stars.sample().boundary().empty()) return;
  int lowest = K;
  for (const Target<K>& t : *targets) lowest = std::min(lowest, t.violation.dimension());
  std::erase_if(*targets, [&](const Target<K>& t) {
    return t.violation.rule > Rule::kSize && t.violation.dimension() > lowest;
  });
  std::vector<Target<K>> kept;
  for (const auto& [star, key, by, sector] : engine_.boundary.TakeSplits()) {
    const std::size_t v = engine_.stars.cell(star, sector).Find(key);
    if (v == engine_.stars.cell(star, sector).vertex_count()) continue;
    if (auto split = Of({star, v, sector}, by)) kept.push_back(*split);
  }
  const auto encroached = [&](const Target<K>& t) {
    std::vector<double> aim(static_cast<std::size_t>(engine_.stars.sample().d()));
    engine_.stars.sample().Lift(t.star, t.x, aim.data());
    return engine_.stars.EncroachedBy(aim.data(), t.violation.walls);
  };
  // The answer to a far target may lie anywhere; good points have several candidates, and after a
  // failed attempt another point is queried.
  const auto may_yield = [&](const Target<K>& t) {
    return t.violation.rule < Rule::kShape && engine_.violations.failed_attempts(t.star) == 0;
  };
  const auto is_near = [](const Target<K>& t) { return !t.violation.fake && !t.is_coarse(); };
  std::vector<std::optional<typename Stars<K>::CellVertex>> first(targets->size());
  ParallelFor(targets->size(), [&](std::size_t i) {
    const Target<K>& t = (*targets)[i];
    if (may_yield(t) && is_near(t)) first[i] = encroached(t);
  });
  for (std::size_t i = 0; i < targets->size(); ++i) {
    CheckInterruption(i);
    const Target<K>& t = (*targets)[i];
    std::optional<Target<K>> target = t;
    const bool is_one = may_yield(t);
    for (int step = 0; target && is_one && is_near(*target) && step < K; ++step) {
      const auto at = step == 0 ? first[i] : encroached(*target);
      if (!at || engine_.violations.is_given_up(at->star)) break;
      target = Of(*at, target->violation.rule);
    }
    if (target)
      kept.push_back(*target);
    else
      engine_.violations.NoteFailedAttempt(t.star);
  }
  *targets = std::move(kept);
}

STELLATE_INSTANTIATE_CLASS(FaceSplits)

}  // namespace stellate::core
