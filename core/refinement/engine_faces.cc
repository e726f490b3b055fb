// The engine's work for manifolds with boundary: faces are meshed by dimension, the lowest first,
// and each insertion yields to faces of lower dimension, as in Ruppert's refinement.

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/boundary/inactive_faces.h"
#include "core/refinement/engine.h"
#include "core/refinement/exchange.h"
#include "core/refinement/protecting_balls.h"

namespace stellate::core {
namespace {

// R2 and R3 never split a boundary simplex below this share of the size bound. With a larger share
// shapes are bad where faces are near each other: of 63 gyroid solids that end just beside the
// corners of their boxes 12 do not close with this, 25 with 0.05, more than half with 0.25.
constexpr double kLeastSplit = 0.02;
// The distance from the sample, in size bounds, at which a boundary point counts as uncovered. A
// corner, which no other point replaces, counts everywhere except at itself.
constexpr double kNewsAway = 0.5;
// On a curved edge the radius of a shell may be a little larger than it was set.
constexpr double kShellLength = 1.1;

// An inactive face of the stage takes a seed at any distance from the sample: it is a small piece
// of walls beside others, without which the mesh would be that of another manifold.
template <int K>
void TakeSeedsOfInactiveFaces(const Stars<K>& stars, int stage,
                              std::vector<typename BoundaryState<K>::Seed>* seeds,
                              std::vector<typename BoundaryState<K>::Seed>* taken) {
  std::erase_if(*seeds, [&](auto& seed) {
    const bool is_taken = std::any_of(taken->begin(), taken->end(),
                                      [&](const auto& other) { return other.walls == seed.walls; });
    if (K - CountWalls(seed.walls) != stage || seed.walls == 0 || is_taken ||
        HasPointOn<K>(stars, seed.walls) || stars.EncroachedBy(seed.point.data(), seed.walls))
      return false;
    taken->push_back(std::move(seed));
    return true;
  });
}

}  // namespace

template <int K>
bool Engine<K>::IsOnShell(const typename Stars<K>::FaceSimplex& simplex) const {
  if (simplex.count != 2) return false;
  const double length = Distance(stars_.sample().Point(simplex.ids[0]),
                                 stars_.sample().Point(simplex.ids[1]), stars_.sample().d());
  return length <= kShellLength * std::max(boundary_.ShellOf(simplex.ids[0]),
                                           boundary_.ShellOf(simplex.ids[1]));
}

template <int K>
bool Engine<K>::IsSliverAtBoundary(std::uint32_t star, const Violation<K>& violation) const {
  if (violation.rule != Rule::kShape || !boundary_.has_walls()) return false;
  const auto simplex = stars_.FaceSimplexOf(star, stars_.cell(star), violation.vertex);
  return std::any_of(simplex.ids.begin(), simplex.ids.begin() + simplex.count,
                     [&](std::uint32_t id) { return stars_.sample().walls(id) != 0; });
}

// Returns the simplex dual to a vertex of a star's cell as a target, to be split although it breaks
// no rule; nothing if it is too small already.
template <int K>
std::optional<Target<K>> Engine<K>::SplitOf(const typename Stars<K>::CellVertex& at,
                                            Rule by) const {
  const auto& cell = stars_.cell(at.star);
  Violation<K> violation;
  violation.rule = std::min(by, Rule::kRadiusEdge);
  violation.radius = std::sqrt(cell.norm2(at.vertex));
  std::copy_n(cell.x(at.vertex), K, violation.x);
  violation.vertex = at.vertex;
  violation.walls = WallsAt<K>(cell, at.vertex);
  violation.encroached = true;
  const auto simplex = stars_.FaceSimplexOf(at.star, cell, at.vertex);
  if (IsOnShell(simplex)) return std::nullopt;
  if (violation.dimension() <= boundary_.left()) return std::nullopt;
  // The middle of an edge between two protecting balls is in both.
  if (simplex.count == 2 && stars_.sample().ProtectingRadius2(simplex.ids[0]) > 0 &&
      stars_.sample().ProtectingRadius2(simplex.ids[1]) > 0)
    return std::nullopt;
  if (by > Rule::kSize && violation.radius < kLeastSplit * sizes_.BoundAt(stars_, at.star))
    return std::nullopt;
  return TargetOf(at.star, violation);
}

// Returns a simplex of a wall to be split instead of a sliver on it, all of whose vertices are on
// that wall, which may be flat, if no point near the sliver was good. The sliver's centre may be on
// the wall itself, and points near it neither cut the sliver off nor encroach on the wall.
template <int K>
std::optional<Target<K>> Engine<K>::SplitUnderSliver(std::uint32_t star,
                                                     const Violation<K>& violation) const {
  if (violation.rule != Rule::kShape || !boundary_.has_walls() || violation.walls != 0 ||
      violations_.failed_attempts(star) == 0)
    return std::nullopt;
  const auto& cell = stars_.cell(star);
  WallSet common = stars_.sample().walls(star);
  for (int s = 0; s < K; ++s)
    common &= stars_.sample().walls(cell.id(cell.facet(violation.vertex, s)));
  if (common == 0) return std::nullopt;
  for (int s = 0; s < K; ++s) {
    const std::size_t below = cell.adjacent(violation.vertex, s);
    if (CountWalls(WallsAt<K>(cell, below)) == 1 && !cell.HasFakeFacet(below))
      return SplitOf({star, below}, Rule::kShape);
  }
  return std::nullopt;
}

// Replaces targets that would encroach on a face of lower dimension by splits of that face, and
// adds the simplices that answers have encroached on. While faces of lower dimension have targets,
// only R1 splits: beside a face that cannot be fixed, no shape ever could be, however small.
template <int K>
void Engine<K>::YieldToFaces(std::vector<Target<K>>* targets) {
  int lowest = K;
  for (const Target<K>& t : *targets) lowest = std::min(lowest, t.violation.dimension());
  std::erase_if(*targets, [&](const Target<K>& t) {
    return t.violation.rule > Rule::kSize && t.violation.dimension() > lowest;
  });
  std::vector<Target<K>> kept;
  for (const auto& [star, key, by] : boundary_.TakeSplits()) {
    const std::size_t v = stars_.cell(star).Find(key);
    if (v == stars_.cell(star).vertex_count()) continue;
    if (auto split = SplitOf({star, v}, by)) kept.push_back(*split);
  }
  const auto encroached = [&](const Target<K>& t) {
    std::vector<double> aim(static_cast<std::size_t>(stars_.sample().d()));
    stars_.sample().Lift(t.star, t.x, aim.data());
    return stars_.EncroachedBy(aim.data(), t.violation.walls);
  };
  // The answer to a far target may lie anywhere; good points have several candidates, and after a
  // failed attempt another point is queried.
  const auto may_yield = [&](const Target<K>& t) {
    return t.violation.rule < Rule::kShape && violations_.failed_attempts(t.star) == 0;
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
      if (!at || violations_.is_given_up(at->star)) break;
      target = SplitOf(*at, target->violation.rule);
    }
    if (target)
      kept.push_back(*target);
    else
      violations_.NoteFailedAttempt(t.star);
  }
  *targets = std::move(kept);
}

template <int K>
PlannedPoints Engine<K>::ChooseSeeds() {
  std::vector<typename BoundaryState<K>::Seed> chosen, left;
  for (auto& seed : boundary_.seeds()) {
    CheckInterruption(chosen.size() + left.size());
    const int dimension = K - CountWalls(seed.walls);
    const double apart =
        dimension == 0 ? BoundaryState<K>::kSameCorner * criteria_.epsilon : criteria_.epsilon;
    const bool covered =
        stars_.sample().AnyWithin(seed.point.data(), apart) ||
        std::any_of(chosen.begin(), chosen.end(), [&](const auto& other) {
          return Distance(other.point.data(), seed.point.data(), stars_.sample().d()) <= apart;
        });
    const bool ripe = dimension == boundary_.stage() && !covered && !is_full() &&
                      !stars_.EncroachedBy(seed.point.data(), seed.walls);
    (ripe ? chosen : left).push_back(std::move(seed));
  }
  if (chosen.empty() && !is_full())
    TakeSeedsOfInactiveFaces<K>(stars_, boundary_.stage(), &left, &chosen);
  boundary_.seeds() = std::move(left);
  if (chosen.empty() && boundary_.stage() == 0 && K > 1 && !boundary_.has_shells())
    return PlanShells();
  PlannedPoints points;
  points.points.resize(stars_.sample().d(), static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    points.points.col(static_cast<Eigen::Index>(i)) = chosen[i].point;
    points.walls.push_back(chosen[i].walls);
  }
  return points;
}

template <int K>
AnsweredPoints Engine<K>::InteriorSeeds() {
  std::vector<const typename BoundaryState<K>::Seed*> seeds;
  for (const auto& seed : boundary_.seeds())
    if (seed.walls == 0 && seed.tangent.size() > 0) seeds.push_back(&seed);
  AnsweredPoints all;
  const auto count = static_cast<Eigen::Index>(seeds.size());
  all.points.resize(stars_.sample().d(), count);
  all.tangents.resize(stars_.sample().d() * K, count);
  all.answered.assign(seeds.size(), 1);
  all.found = all.answered;
  for (Eigen::Index c = 0; c < count; ++c) {
    all.points.col(c) = seeds[static_cast<std::size_t>(c)]->point;
    all.tangents.col(c) = seeds[static_cast<std::size_t>(c)]->tangent;
  }
  return all;
}

template <int K>
bool Engine<K>::AdvanceStage() {
  if (!boundary_.Advance()) return false;
  if (boundary_.stage() == K) stars_.IncludeInterior();
  RejudgeAll();
  MarkAllDirty();
  violations_.ForgetAttempts();
  return true;
}

template <int K>
bool Engine<K>::LeaveStage() {
  if (!boundary_.has_walls() || boundary_.stage() == K) return false;
  boundary_.Leave();
  return AdvanceStage();
}

// In boundary-only mode stars are built only as far as the boundary is known.
template <int K>
void Engine<K>::CompleteStars(std::vector<std::uint32_t>* added,
                              std::vector<std::uint32_t>* removed) {
  if (boundary_.stage() == K || stars_.size() == 0) return;
  const std::vector<std::uint32_t> before = stars_.Simplices();
  stars_.IncludeInterior();
  stars_.Commit();
  ExchangeSimplices<K>(before, stars_.Simplices(), added, removed);
}

template <int K>
bool Engine<K>::NeedsProtectingBalls(const std::vector<Target<K>>& targets) const {
  return K == 3 && boundary_.stage() >= 1 && !boundary_.has_discoveries() &&
         std::all_of(targets.begin(), targets.end(),
                     [](const Target<K>& t) { return t.violation.dimension() >= 2; }) &&
         NeedsProtection<K>(stars_);
}

template <int K>
std::optional<std::vector<Target<K>>> Engine<K>::ProtectSharpEdges(
    std::vector<std::uint32_t>* added, std::vector<std::uint32_t>* removed) {
  ProtectingBalls<K> balls = PlanProtectingBalls<K>(stars_, sizes_);
  if (boundary_.MaySplitForBalls(stars_.size(), MostSplits<K>(balls))) {
    std::vector<Target<K>> splits;
    for (const auto& gap : balls.gaps)
      if (!violations_.is_given_up(gap.star))
        if (const auto split = SplitOf(gap, Rule::kSize)) splits.push_back(*split);
    if (!splits.empty()) return splits;
  }
  boundary_.NoteProtected();
  const std::vector<std::uint32_t> before = stars_.Simplices();
  stars_.SetProtectingBalls(std::move(balls.radii2));
  ExchangeSimplices<K>(before, stars_.Simplices(), added, removed);
  RejudgeAll();
  MarkAllDirty();
  violations_.ForgetAttempts();
  return Plan();
}

template <int K>
PlannedPoints Engine<K>::TakeDiscoveries() {
  const auto found = boundary_.TakeDiscoveries();
  PlannedPoints planned;
  const auto count = static_cast<Eigen::Index>(found.size());
  planned.points.resize(stars_.sample().d(), count);
  planned.spacing.resize(count);
  planned.rules.assign(found.size(), Rule::kSize);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    planned.points.col(column) = found[i].point;
    planned.walls.push_back(found[i].walls);
    planned.spacing[column] =
        criteria_.epsilon *
        (CountWalls(found[i].walls) == K ? BoundaryState<K>::kSameCorner : kNewsAway);
  }
  return planned;
}

template <int K>
std::vector<FaceMesh> Engine<K>::Faces() const {
  using Simplex = std::array<std::uint32_t, K + 1>;  // as many of them as the face has corners
  std::map<std::pair<int, WallSet>, std::vector<Simplex>> faces;
  for (std::uint32_t p = 0; p < stars_.size(); ++p) {
    CheckInterruption(p);
    if (stars_.sample().walls(p) == 0) continue;
    const auto& cell = stars_.cell(p);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const auto simplex = stars_.FaceSimplexOf(p, cell, v);
      if (simplex.walls == 0 || simplex.fake || simplex.ids[0] != p) continue;
      // A corner of more walls than K has several vertices of its cell at itself.
      const WallSet walls = simplex.dimension() == 0 ? stars_.sample().walls(p) : simplex.walls;
      Simplex& corners = faces[{simplex.dimension(), walls}].emplace_back();
      std::copy_n(simplex.ids.begin(), simplex.count, corners.begin());
    }
  }
  std::vector<FaceMesh> all;
  for (auto& [key, simplices] : faces) {
    std::sort(simplices.begin(), simplices.end());
    simplices.erase(std::unique(simplices.begin(), simplices.end()), simplices.end());
    FaceMesh face{key.second, key.first, {}};
    for (const Simplex& s : simplices)
      face.simplices.insert(face.simplices.end(), s.begin(), s.begin() + key.first + 1);
    all.push_back(std::move(face));
  }
  return all;
}

#define STELLATE_EACH(K)                                                                         \
  template std::optional<Target<K>> Engine<K>::SplitOf(const Stars<K>::CellVertex&, Rule) const; \
  template std::optional<Target<K>> Engine<K>::SplitUnderSliver(std::uint32_t,                   \
                                                                const Violation<K>&) const;      \
  template void Engine<K>::YieldToFaces(std::vector<Target<K>>*);                                \
  template PlannedPoints Engine<K>::ChooseSeeds();                                               \
  template AnsweredPoints Engine<K>::InteriorSeeds();                                            \
  template bool Engine<K>::IsSliverAtBoundary(std::uint32_t, const Violation<K>&) const;         \
  template bool Engine<K>::IsOnShell(const Stars<K>::FaceSimplex&) const;                        \
  template bool Engine<K>::AdvanceStage();                                                       \
  template bool Engine<K>::LeaveStage();                                                         \
  template void Engine<K>::CompleteStars(std::vector<std::uint32_t>*,                            \
                                         std::vector<std::uint32_t>*);                           \
  template bool Engine<K>::NeedsProtectingBalls(const std::vector<Target<K>>&) const;            \
  template std::optional<std::vector<Target<K>>> Engine<K>::ProtectSharpEdges(                   \
      std::vector<std::uint32_t>*, std::vector<std::uint32_t>*);                                 \
  template std::vector<FaceMesh> Engine<K>::Faces() const;                                       \
  template PlannedPoints Engine<K>::TakeDiscoveries();
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
