// How the star of one point more is built among those that there are.

#include <algorithm>
#include <functional>
#include <utility>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/complex/around.h"
#include "core/complex/cut_by_near.h"
#include "core/complex/star_complex.h"
#include "core/geometry/laid_polygon.h"
#include "core/geometry/laid_polytope.h"

namespace stellate::core {
namespace {

// How much farther than its star in the flats reaches the neighbours of a new point are gathered:
// judged stars are mostly that much larger at most.
constexpr double kJudgedReach = 1.1;
// ... and how far at most, in epsilon: a star that is open so far would gather half of the sample.
constexpr double kFarthest = 5;
// As far a star is cut all along, in epsilon, before it is known how far it reaches.
constexpr double kAtFirst = 2;

}  // namespace

// At common centres cuts are refused that would leave no polytope, and a cell may stay open in the
// midst of the sample, to which R1 would add points forever. It is closed in the flats then, and
// judged: where it is not as it would be there stars disagree, which R4 mends.
template <int K>
void StarComplex<K>::CloseInFlats(const Site& p, Cell& cell,
                                  typename Cell::Scratch& scratch) const {
  if (K < 3 || judging_ != Judging::kCommonCentre || p.walls != 0 || cell.bounded()) return;
  thread_local Cell flat;
  ResetInFlats(flat, p);
  tree_.VisitNear(
      p.point, [&] { return Influence(p.id, flat); },
      [&](std::uint32_t q, double) {
        if (q != p.id) ClipInFlats(flat, p, At(q), scratch);
      });
  if (!flat.bounded()) return;
  JudgeCell(flat, p, {});
  cell = flat;
}

// What closes the cell, or nearly so, comes first: without it a search that happens to begin on one
// side of p would visit all of that side while the cell is open towards the other.
template <int K>
template <typename Clip>
const std::vector<std::uint32_t>& StarComplex<K>::ClipByNeighbourhood(const Site& p,
                                                                      std::uint32_t near,
                                                                      const Clip& clip) const {
  thread_local std::vector<std::uint32_t> first;
  Neighbourhood(p.point, near, &first);
  for (const std::uint32_t q : first)
    if (q != p.id) clip(q);
  return first;
}

// As most stars that are laid: made in the flats, and judged when it is done. False where that will
// not do, which hangs on what lies around p alone. Asks once about whom p influences, whatever it
// returns.
template <int K>
template <typename Influencing>
bool StarComplex<K>::BuildAsInFlats(const Site& p, std::uint32_t near, Cell& cell,
                                    const Influencing& influencing) const {
  LaidPolytope& polytope = ThreadPolytope();
  thread_local Near around;
  Step step(d_);
  polytope.Reset(inradius_);
  const auto clip = [&](std::uint32_t q) { ClipApart(p, q, step.data(), &polytope); };
  const auto& first = ClipByNeighbourhood(p, near, clip);
  const auto judged_reach = [&] { return kJudgedReach * Influence(p.id, polytope.max_norm2()); };
  const double farthest = kFarthest * epsilon(), gathered = std::min(judged_reach(), farthest);
  around.clear();
  tree_.VisitAround(
      p.point, [&] { return gathered; },
      [&](std::uint32_t q, double distance2) {
        if (q != p.id) around.emplace_back(distance2, q);
      },
      influencing);
  std::sort(around.begin(), around.end());
  for (const auto& [distance2, q] : around)
    if (std::find(first.begin(), first.end(), q) == first.end()) clip(q);
  const double reach = judged_reach();
  if (polytope.gave_up() || reach > farthest) return false;
  cell.Take(polytope);
  return JudgeCell(cell, p, around) && Influence(p.id, cell) <= reach;
}

// A star in the flats, K = 3, made apart. False where that will not do. Asks once about whom p
// influences, whatever it returns.
template <int K>
template <typename Influencing>
bool StarComplex<K>::BuildPolytope(const Site& p, std::uint32_t near, Cell& cell,
                                   const Influencing& influencing) const {
  LaidPolytope& polytope = ThreadPolytope();
  Step step(d_);
  polytope.Reset(inradius_);
  const auto clip = [&](std::uint32_t q) { return ClipApart(p, q, step.data(), &polytope); };
  const auto& first = ClipByNeighbourhood(p, near, clip);
  double reach = InfluenceWithin(polytope.max_norm2());
  tree_.VisitAround(
      p.point, [&] { return reach; },
      [&](std::uint32_t q, double) {
        if (q == p.id || std::find(first.begin(), first.end(), q) != first.end()) return;
        if (clip(q)) reach = InfluenceWithin(polytope.max_norm2());
      },
      influencing);
  if (polytope.gave_up()) return false;
  cell.Take(polytope);
  return true;
}

// The cuts in one order, whatever is known of what lies near: at common centres it may tell.
template <int K>
void StarComplex<K>::BuildNearestFirst(const Site& p, const Site* guest, Cell& cell,
                                       typename Cell::Scratch& scratch) const {
  thread_local Near near;
  near.clear();
  const auto search = [&](double from, double to) {
    tree_.VisitNear(
        p.point, [&] { return to; },
        [&](std::uint32_t q, double distance2) {
          if (q != p.id && (distance2 > from * from || from == 0)) near.emplace_back(distance2, q);
        });
  };
  ResetCell(cell, p, guest, scratch);
  search(0, kAtFirst * epsilon());
  std::sort(near.begin(), near.end());
  CutByNear(
      &near, kAtFirst * epsilon(), [&] { return Influence(p.id, cell); },
      [&](std::uint32_t q) { return ClipBy(cell, p, At(q), guest, nullptr, scratch); }, search);
  if (guest == nullptr) CloseInFlats(p, cell, scratch);
}

template <int K>
template <typename Influencing>
void StarComplex<K>::BuildStar(const Site& p, const Site* guest, std::uint32_t near, Cell& cell,
                               typename Cell::Scratch& scratch,
                               const Influencing& influencing) const {
  bool is_asked = false;  // about whom p influences
  if constexpr (K == 3) {
    if (judging_ == Judging::kCommonCentre && p.walls == 0 && !faces_alone_) {
      if (!BuildAsInFlats(p, near, cell, influencing)) BuildNearestFirst(p, guest, cell, scratch);
      return;
    }
    if (p.walls == 0 && !faces_alone_ && !has_guards()) {
      if (BuildPolytope(p, near, cell, influencing)) return;
      is_asked = true;
    }
  }
  // In the flats, K = 2, a polygon is made apart, where each half-space is found once.
  thread_local LaidPolygon polygon;
  const bool apart =
      K == 2 && judging_ == Judging::kFlats && guest == nullptr && p.walls == 0 && !has_guards();
  const double weight = Weight(p.id);
  if (apart)
    polygon.Reset(inradius_);
  else
    ResetCell(cell, p, guest, scratch);
  const auto clip = [&](std::uint32_t q) {
    return apart ? polygon.ClipBy(q, d_, p.point, p.tangent, weight, Point(q), Weight(q))
                 : ClipBy(cell, p, At(q), guest, nullptr, scratch);
  };
  const auto reach_now = [&] {
    return apart ? InfluenceWithin(polygon.max_norm2()) : Influence(p.id, cell);
  };
  const auto& first = ClipByNeighbourhood(p, near, clip);
  double reach = reach_now();
  tree_.VisitAround(
      p.point, [&] { return reach; },
      [&](std::uint32_t q, double) {
        // Once by each point: a second cut by the same plane would be decided by rounding.
        if (q == p.id || std::find(first.begin(), first.end(), q) != first.end()) return;
        if (clip(q)) reach = reach_now();
      },
      [&](std::uint32_t q) {
        if (!is_asked) influencing(q);
      });
  if constexpr (K == 2)
    if (apart) cell.Take(polygon);
  if (guest == nullptr) CloseInFlats(p, cell, scratch);
}

// Also says which old stars each new point cuts, by star: their influence is still that of before.
template <int K>
std::vector<typename StarComplex<K>::Cut> StarComplex<K>::BuildNewStars(std::uint32_t first) {
  cells_.resize(size());
  std::vector<Cut> cuts = ParallelGather<Cut>(near_.size(), [&](std::size_t i, auto* found) {
    thread_local typename Cell::Scratch scratch;
    thread_local Cell cell;  // its memory is used again; what is kept is no larger than it must be
    const Site q = At(first + static_cast<std::uint32_t>(i));
    BuildStar(q, nullptr, near_[i], cell, scratch, [&](std::uint32_t p) {
      if (Cuts(cells_[p], At(p), q)) found->push_back({p, q.id});
    });
    cells_[q.id] = cell;
  });
  near_.clear();
  ParallelSort(cuts, std::less<>());
  return cuts;
}

template <int K>
void StarComplex<K>::TryPoint(const double* point, const double* tangent, std::uint32_t near,
                              typename Cell::Scratch& scratch, Tentative* result, WallSet walls,
                              const double* conormals) const {
  const Site guest{size(), point, tangent, walls, conormals};
  result->cut.clear();
  BuildStar(guest, &guest, near, result->own, scratch, [&](std::uint32_t p) {
    if (Cuts(cells_[p], At(p), guest)) result->cut.emplace_back(p, cells_[p]);
  });
  for (auto& [p, cell] : result->cut) ClipBy(cell, At(p), guest, &guest, &result->own, scratch);
  std::sort(result->cut.begin(), result->cut.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
}

#define STELLATE_EACH(K)                                                                         \
  template void StarComplex<K>::CloseInFlats(const Site&, Cell&, typename Cell::Scratch&) const; \
  template void StarComplex<K>::BuildNearestFirst(const Site&, const Site*, Cell&,               \
                                                  typename Cell::Scratch&) const;                \
  template std::vector<StarComplex<K>::Cut> StarComplex<K>::BuildNewStars(std::uint32_t);        \
  template void StarComplex<K>::TryPoint(const double*, const double*, std::uint32_t,            \
                                         typename Cell::Scratch&, Tentative*, WallSet,           \
                                         const double*) const;
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
