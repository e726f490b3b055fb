// How a sample is laid at once: all of it, or all but the boundary's.

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/room.h"
#include "core/complex/around.h"
#include "core/complex/cut_by_near.h"
#include "core/complex/star_complex.h"
#include "core/geometry/laid_polytope.h"

namespace stellate::core {
namespace {

// Where no circumradius is above the size bound nothing farther than twice that cuts a star.
constexpr double kGathered = 2 * (1 + 1e-6);
// Before R1 many a star reaches farther, and few beyond this.
constexpr double kSearched = 2.5;

// The rules mostly insert fewer points into a laid sample than one in so many.
constexpr std::size_t PartsToCome(int k) { return k <= 2 ? 8 : 4; }

using Near = std::vector<std::pair<double, std::uint32_t>>;  // squared distances, and who is there

// What lies around a bunch of points, by coordinate: distances to it all are taken side by side.
class LaidAround {
 public:
  void Take(const std::vector<std::uint32_t>& ids, const std::vector<double>& points, int d) {
    ids_ = &ids;
    points_ = &points;
    const std::size_t count = ids.size(), stride = static_cast<std::size_t>(d);
    coordinates_.resize(stride * count);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t j = 0; j < stride; ++j)
        coordinates_[j * count + i] = points[ids[i] * stride + j];
    distances2_.resize(count);
  }

  // Parts what lies within `searched` of p, without p itself, by whether it is within `gathered`.
  void Part(std::uint32_t p, int d, double gathered, double searched, Near* near, Near* beyond) {
    near->clear();
    beyond->clear();
    WithDimension(d, [&](auto known) { MeasureFrom<known()>(p, d); });
    const std::vector<std::uint32_t>& ids = *ids_;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const double distance2 = distances2_[i];
      if (distance2 > searched * searched || ids[i] == p) continue;
      (distance2 <= gathered * gathered ? near : beyond)->emplace_back(distance2, ids[i]);
    }
  }

 private:
  template <int D>
  void MeasureFrom(std::uint32_t p, int any_d) {
    const std::size_t count = ids_->size(), stride = static_cast<std::size_t>(any_d);
    const double* const point = points_->data() + p * stride;
    double* const distances2 = distances2_.data();
    if constexpr (D > 0) {
      const double* const coordinates = coordinates_.data();
      const double origin[D] = {};
      for (std::size_t i = 0; i < count; ++i) {
        double away[D];  // its sum of squares is taken in SquaredDistance's order
        for (std::size_t j = 0; j < D; ++j) away[j] = coordinates[j * count + i] - point[j];
        distances2[i] = SquaredDistance(away, origin, D);
      }
    } else {
      for (std::size_t i = 0; i < count; ++i)
        distances2[i] = SquaredDistance(point, points_->data() + (*ids_)[i] * stride, any_d);
    }
  }

  const std::vector<std::uint32_t>* ids_ = nullptr;
  const std::vector<double>* points_ = nullptr;
  std::vector<double> coordinates_, distances2_;
};

// What lies from `from` to `to` around a point: of all within `searched` of it `beyond` holds what
// is beyond `from`.
void AppendBetween(const BallTree& tree, const double* point, const Near& beyond, double searched,
                   double from, double to, Near* near) {
  for (const auto& [distance2, q] : beyond)
    if (distance2 > from * from && distance2 <= to * to) near->emplace_back(distance2, q);
  if (to <= searched) return;
  from = std::max(from, searched);
  tree.VisitNear(
      point, [&] { return to; },
      [&](std::uint32_t q, double distance2) {
        if (distance2 > from * from) near->emplace_back(distance2, q);
      });
}

}  // namespace

template <int K>
void StarComplex<K>::Lay(const double* point, const double* tangent) {
  points_.insert(points_.end(), point, point + d_);
  tangents_.insert(tangents_.end(), tangent, tangent + d_ * K);
}

template <int K>
void StarComplex<K>::NameLast(std::uint32_t name) {
  const std::uint32_t last = size() - 1;
  if (name == last) return;
  for (auto id = static_cast<std::uint32_t>(names_.size()); id < last; ++id) names_.push_back(id);
  names_.push_back(name);
}

// The cell in the flats, made apart where K = 3. `near` holds all that lies within `known`, as
// CutByNear has it.
template <int K>
template <typename Search>
void StarComplex<K>::CutInFlats(const Site& p, Near* near, double* known, const Search& search,
                                Cell& cell, typename Cell::Scratch& scratch) const {
  if constexpr (K == 3) {
    LaidPolytope& polytope = ThreadPolytope();
    Step step(d_);
    polytope.Reset(inradius_);
    *known = CutByNear(
        near, *known, [&] { return Influence(p.id, polytope.max_norm2()); },
        [&](std::uint32_t q) { return ClipApart(p, q, step.data(), &polytope); }, search);
    if (!polytope.gave_up()) return cell.Take(polytope);
  }
  ResetInFlats(cell, p);
  *known = CutByNear(
      near, *known, [&] { return Influence(p.id, cell); },
      [&](std::uint32_t q) { return ClipInFlats(cell, p, At(q), scratch); }, search);
}

// Most stars are the same in the flats, where clips cost a fraction: only those are judged all
// along of which that is not so. `near` holds all that lies within `known`, as CutByNear has it.
template <int K>
template <typename Search>
bool StarComplex<K>::BuildInFlats(const Site& p, Near* near, double* known, const Search& search,
                                  Cell& cell, typename Cell::Scratch& scratch) const {
  CutInFlats(p, near, known, search, cell, scratch);
  return JudgeCell(cell, p, *near) && Influence(p.id, cell) <= *known;
}

// `around` holds at least what lies within kSearched size bounds of p.
template <int K>
template <typename Laid>
void StarComplex<K>::BuildLaidStarFrom(std::uint32_t p, Laid& around, Cell& cell) const {
  thread_local typename Cell::Scratch scratch;
  thread_local Near near, beyond;
  const Site site = At(p);
  const double gathered = kGathered * LaidBound(p), searched = kSearched * LaidBound(p);
  around.Part(p, d_, gathered, searched, &near, &beyond);
  std::sort(near.begin(), near.end());
  double known = gathered;
  const auto search = [&](double from, double to) {
    AppendBetween(tree_, site.point, beyond, searched, from, to, &near);
  };
  const bool is_inside = site.walls == 0;
  if (is_inside && K > 2 && judging_ == Judging::kCommonCentre &&
      BuildInFlats(site, &near, &known, search, cell, scratch))
    return;
  ResetCell(cell, site, nullptr, scratch);
  CutByNear(
      &near, known, [&] { return Influence(p, cell); },
      [&](std::uint32_t q) { return ClipBy(cell, site, At(q), nullptr, nullptr, scratch); },
      search);
  CloseInFlats(site, cell, scratch);
}

template <int K>
void StarComplex<K>::BuildLaidStar(std::uint32_t p, const std::vector<std::uint32_t>& ids,
                                   Cell& cell) const {
  thread_local LaidAround around;
  around.Take(ids, points_, d_);
  BuildLaidStarFrom(p, around, cell);
}

template <int K>
void StarComplex<K>::BuildAllLaidStars(double* influence) {
  if constexpr (K == 2)
    if (judging_ == Judging::kFlats && !has_guards()) return BuildAllLaidPolygons(influence);
  const std::vector<BallTree::Bunch> bunches = tree_.Bunches();
  ParallelFor(bunches.size(), [&](std::size_t b) {
    thread_local std::vector<std::uint32_t> ids;
    thread_local LaidAround around;
    thread_local Cell cell;  // its memory is used again; what is kept is no larger than it must be
    const BallTree::Bunch& bunch = bunches[b];
    ids.clear();
    double most = 0;
    for (std::uint32_t i = 0; i < bunch.count; ++i) most = std::max(most, LaidBound(bunch.ids[i]));
    tree_.GatherAround(bunch, kSearched * most, &ids);
    around.Take(ids, points_, d_);
    for (std::uint32_t i = 0; i < bunch.count; ++i) {
      const std::uint32_t p = bunch.ids[i];
      BuildLaidStarFrom(p, around, cell);
      cells_[p] = cell;
      influence[p] = Influence(p, cell);
    }
  });
}

template <int K>
typename StarComplex<K>::Change StarComplex<K>::BuildLaidStars() {
  Change change;
  change.removed = Simplices();
  faces_alone_ = becomes_whole_ = false;
  change.stars.resize(cells_.size());
  std::iota(change.stars.begin(), change.stars.end(), std::uint32_t{0});
  centre_owner_ = CentreCache<K>::NewOwner();
  LeaveRoom(PartsToCome(K), &points_);
  LeaveRoom(PartsToCome(K), &tangents_);
  cells_.resize(size());
  tree_.Assign(std::vector<double>(size(), 0.0), BallTree::Halving::kExtent);
  tree_.LeaveRoom(PartsToCome(K));
  std::vector<double> influence(size());
  BuildAllLaidStars(influence.data());
  tree_.SetInfluences(std::move(influence));
  MeasureFaces({}, 0);
  laid_bounds_ = {};
  change.added = ParallelGather<std::uint32_t>(size(), [&](std::size_t p, auto* ids) {
    ForEachOwned(static_cast<std::uint32_t>(p), [&](std::size_t, const Simplex& s) {
      ids->insert(ids->end(), s.begin(), s.end());
    });
  });
  simplex_count_ = change.added.size() / (K + 1);
  return change;
}

#define STELLATE_EACH(K)                                                                        \
  template void StarComplex<K>::Lay(const double*, const double*);                              \
  template void StarComplex<K>::NameLast(std::uint32_t);                                        \
  template void StarComplex<K>::BuildLaidStar(std::uint32_t, const std::vector<std::uint32_t>&, \
                                              Cell&) const;                                     \
  template void StarComplex<K>::BuildAllLaidStars(double*);                                     \
  template StarComplex<K>::Change StarComplex<K>::BuildLaidStars();
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
