// How stars are built and cut for K = 2 in the flats, where they are polygons that are made apart.

#include <algorithm>
#include <cmath>
#include <span>

#include "core/base/parallel.h"
#include "core/complex/star_complex.h"
#include "core/geometry/laid_polygon.h"

namespace stellate::core {
namespace {

// In size bounds. Where no circumradius is above the bound nothing farther than 2 cuts a star.
// Before R1 one star in five may be cut from farther than the first of these, and hardly any from
// farther than the second.
constexpr double kNear = 2.5, kFar = 3.2;
// One search serves bunches that lie together: so many size bounds apart at most, and not many more
// points than this.
constexpr double kTogether = 6;
constexpr std::uint32_t kMostTogether = 24;
// More than rounding can take from a distance in R^d, d up to thousands.
constexpr double kRounding = 1 + 1e-12;

// Points of the sample side by side in memory, as they are read again and again.
struct Gathered {
  std::size_t count = 0;
  std::vector<std::uint32_t> ids;  // `count`, and room for more
  std::vector<double> points;      // likewise, d each
};

// A point near another: how far it is, and who it is.
struct Found {
  double distance2;
  std::uint32_t id;

  // Nearest first.
  bool operator<(const Found& other) const {
    return distance2 != other.distance2 ? distance2 < other.distance2 : id < other.id;
  }
};

// Gathers those of `ids` that lie within `reach` of a point, and such as only rounding keeps out.
void Gather(const std::vector<std::uint32_t>& ids, const double* points, int any_d,
            const double* centre, double reach, Gathered* gathered) {
  const std::size_t numbers = ids.size() * static_cast<std::size_t>(any_d);
  if (gathered->ids.size() < ids.size()) gathered->ids.resize(ids.size());
  if (gathered->points.size() < numbers) gathered->points.resize(numbers);
  const double far2 = kRounding * reach * kRounding * reach;
  gathered->count = WithDimension(any_d, [&](auto fixed) {
    const int d = fixed() > 0 ? fixed() : any_d;
    std::uint32_t* to = gathered->ids.data();
    double* x = gathered->points.data();
    for (const std::uint32_t id : ids) {
      const double* const q = points + id * static_cast<std::size_t>(d);
      if (!(SquaredDistance(centre, q, d) <= far2)) continue;
      *to++ = id;
      for (int i = 0; i < d; ++i) *x++ = q[i];
    }
    return static_cast<std::size_t>(to - gathered->ids.data());
  });
}

// Those gathered that lie within `reach` of a point, nearest first.
std::span<const Found> NearestFirst(const Gathered& gathered, const double* point, int any_d,
                                    double reach, std::vector<Found>* room) {
  if (room->size() < gathered.count) room->resize(gathered.count);
  Found* const found = room->data();
  const double reach2 = reach * reach;
  const std::size_t count = WithDimension(any_d, [&](auto fixed) {
    const int d = fixed() > 0 ? fixed() : any_d;
    const double* q = gathered.points.data();
    std::size_t next = 0;
    for (std::size_t i = 0; i < gathered.count; ++i, q += d) {
      const double distance2 = SquaredDistance(point, q, d);
      found[next] = {distance2, gathered.ids[i]};
      next += distance2 <= reach2;
    }
    return next;
  });
  std::sort(found, found + count);
  return {found, count};
}

// One a thread, for the life of the thread.
LaidPolygon& ThreadPolygon() {
  thread_local LaidPolygon polygon;
  return polygon;
}

// Cuts by what lies around a point, nearest first and ties by id, out to where nothing can cut any
// more: by what was gathered, which is all there is within `known`, and then by what search(reach)
// gathers. Returns how far that is.
template <typename Reach, typename Clip, typename Search>
double CutNearestFirst(const double* point, int d, const Gathered* gathered, double known,
                       const Reach& reach_now, const Clip& clip, const Search& search) {
  thread_local std::vector<Found> room;
  double reach = reach_now();
  for (double done2 = -1;;) {
    for (const Found& q : NearestFirst(*gathered, point, d, known, &room)) {
      if (q.distance2 > reach * reach) break;
      if (q.distance2 > done2 && clip(q.id)) reach = reach_now();
    }
    if (reach <= known) return reach;
    done2 = known * known;
    known = std::min(reach, 2 * known);
    gathered = search(known);
  }
}

// Cuts the tree's bunches into stretches that one search serves: where each begins.
std::vector<std::size_t> CutIntoStretches(const std::vector<BallTree::Bunch>& bunches, int d,
                                          const auto& bound) {
  std::vector<std::size_t> begins;
  std::uint32_t count = kMostTogether;
  for (std::size_t b = 0; b < bunches.size(); ++b) {
    CheckInterruption(b);
    const double apart = kTogether * bound(bunches[b].ids[0]);
    if (count >= kMostTogether ||
        SquaredDistance(bunches[begins.back()].centre, bunches[b].centre, d) > apart * apart) {
      begins.push_back(b);
      count = 0;
    }
    count += bunches[b].count;
  }
  begins.push_back(bunches.size());
  return begins;
}

// The ball around bunches: writes its centre, returns its radius.
double BallAround(std::span<const BallTree::Bunch> bunches, int d, std::vector<double>* centre) {
  centre->assign(static_cast<std::size_t>(d), 0.0);
  for (const BallTree::Bunch& bunch : bunches)
    for (std::size_t i = 0; i < centre->size(); ++i)
      (*centre)[i] += bunch.centre[i] / static_cast<double>(bunches.size());
  double radius = 0;
  for (const BallTree::Bunch& bunch : bunches)
    radius = std::max(radius, Distance(centre->data(), bunch.centre, d) + bunch.radius);
  return radius;
}

}  // namespace

// A search for all of them, of which a part is copied for each bunch: most of the time goes into
// looking which of that are near a point.
template <>
void StarComplex<2>::BuildLaidPolygons(std::span<const BallTree::Bunch> bunches,
                                       double* influence) {
  thread_local std::vector<std::uint32_t> around, farther;
  thread_local Gathered gathered, more;
  thread_local std::vector<double> centre;
  thread_local Cell cell;
  LaidPolygon& polygon = ThreadPolygon();
  const double radius = BallAround(bunches, d_, &centre);
  double most = 0;
  for (const BallTree::Bunch& bunch : bunches)
    for (std::uint32_t i = 0; i < bunch.count; ++i) most = std::max(most, LaidBound(bunch.ids[i]));
  around.clear();
  tree_.Gather(centre.data(), kRounding * (radius + kFar * most), &around);
  for (const BallTree::Bunch& bunch : bunches) {
    Gather(around, points_.data(), d_, bunch.centre, bunch.radius + kNear * most, &gathered);
    for (const std::uint32_t p : std::span(bunch.ids, bunch.count)) {
      const Site site = At(p);
      if (site.walls != 0) {
        BuildLaidStar(p, around, cell);
        cells_[p] = cell;
        influence[p] = Influence(p, cell);
        continue;
      }
      const double weight = Weight(p);
      const auto search = [&](double reach) {
        const bool is_near = reach <= kFar * LaidBound(p);
        farther.clear();
        if (!is_near) tree_.Gather(site.point, reach, &farther);
        Gather(is_near ? around : farther, points_.data(), d_, site.point, reach, &more);
        return &more;
      };
      polygon.Reset(inradius_);
      influence[p] = CutNearestFirst(
          site.point, d_, &gathered, kNear * LaidBound(p),
          [&] { return InfluenceWithin(polygon.max_norm2()); },
          [&](std::uint32_t q) {
            return q != p &&
                   polygon.ClipBy(q, d_, site.point, site.tangent, weight, Point(q), Weight(q));
          },
          search);
      cells_[p].Take(polygon);
    }
  }
}

template <>
void StarComplex<2>::BuildAllLaidPolygons(double* influence) {
  const std::vector<BallTree::Bunch> bunches = tree_.Bunches();
  const std::vector<std::size_t> begins =
      CutIntoStretches(bunches, d_, [this](std::uint32_t p) { return LaidBound(p); });
  ParallelFor(begins.size() - 1, [&](std::size_t i) {
    BuildLaidPolygons(std::span(bunches).subspan(begins[i], begins[i + 1] - begins[i]), influence);
  });
}

// The half-spaces of facets beside a cut are found as they are needed, once each.
template <>
void StarComplex<2>::CutPolygon(std::uint32_t p, std::span<const Cut> cuts) {
  LaidPolygon& polygon = ThreadPolygon();
  const Site site = At(p);
  const double weight = Weight(p);
  const auto half_space = [&](std::uint32_t q, double* normal) {
    if (IsFake(q)) return FakeHalfSpace<2>(static_cast<int>(q - kFirstFakeId), inradius_, normal);
    return polygon.HalfSpace(d_, site.point, site.tangent, weight, Point(q), Weight(q), normal);
  };
  polygon.Resume(cells_[p]);
  for (const Cut& cut : cuts)
    polygon.ClipBy(cut.by, d_, site.point, site.tangent, weight, Point(cut.by), Weight(cut.by),
                   half_space);
  cells_[p].Take(polygon);
}

}  // namespace stellate::core
