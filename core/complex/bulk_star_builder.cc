#include "core/complex/bulk_star_builder.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/base/parallel.h"
#include "core/geometry/draft_polygon.h"
#include "core/parts/share_out.h"

namespace stellate::core {
namespace {

// In size bounds. If no circumradius is above the bound, no point farther than twice that cuts a
// star. Before R1 many stars reach farther, and few beyond kSearched.
constexpr double kGathered = 2 * (1 + 1e-6);
constexpr double kSearched = 2.5;

// The points around a bunch of points, by coordinate: distances to all of them are computed side by
// side.
class PointsAround {
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

  // Divides the points within `searched` of p, without p itself, by whether they are within
  // `gathered`.
  void Part(std::uint32_t p, int d, double gathered, double searched, NearPoints* near,
            NearPoints* beyond) {
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

// The points at distances from `from` to `to`: of all within `searched`, `beyond` holds those
// beyond `from`.
void AppendBetween(const BallTree& tree, const double* point, const NearPoints& beyond,
                   double searched, double from, double to, NearPoints* near) {
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

// The same for polygons: before R1 points farther than the first of these cut one star in five, and
// points farther than the second hardly any.
constexpr double kPolygonNear = 2.5, kPolygonFar = 3.2;
// One search serves neighbouring bunches: so many size bounds apart at most, and not many more
// points than this.
constexpr double kTogether = 6;
constexpr std::uint32_t kMostTogether = 24;
// More than rounding can take from a distance in R^d, d up to thousands.
constexpr double kRounding = 1 + 1e-12;

// A point near another one: its distance and its id.
struct FoundPoint {
  double distance2;
  std::uint32_t id;

  // Nearest first.
  bool operator<(const FoundPoint& other) const {
    return distance2 != other.distance2 ? distance2 < other.distance2 : id < other.id;
  }
};

// Gathers those of `ids` that lie within `reach` of a point, and those that only rounding excludes.
void Gather(const std::vector<std::uint32_t>& ids, const double* points, int any_d,
            const double* centre, double reach, GatheredPoints* gathered) {
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

// Returns the gathered points within `reach` of a point, nearest first.
std::span<const FoundPoint> NearestFirst(const GatheredPoints& gathered, const double* point,
                                         int any_d, double reach, std::vector<FoundPoint>* memory) {
  if (memory->size() < gathered.count) memory->resize(gathered.count);
  FoundPoint* const found = memory->data();
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

// Cuts by the points around a point, nearest first and ties by id, as far as points can cut: first
// by those gathered, which are all points within `known`, and then by those that search(reach)
// gathers. Returns the distance up to which points can cut.
template <typename Reach, typename Clip, typename Search>
double CutNearestFirst(const double* point, int d, const GatheredPoints* gathered, double known,
                       const Reach& reach_now, const Clip& clip, const Search& search) {
  thread_local std::vector<FoundPoint> memory;
  double reach = reach_now();
  for (double done2 = -1;;) {
    for (const FoundPoint& q : NearestFirst(*gathered, point, d, known, &memory)) {
      if (q.distance2 > reach * reach) break;
      if (q.distance2 > done2 && clip(q.id)) reach = reach_now();
    }
    if (reach <= known) return reach;
    done2 = known * known;
    known = std::min(reach, 2 * known);
    gathered = search(known);
  }
}

// Divides the tree's bunches into runs that one search serves, and returns where each begins.
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

// Writes the centre of the ball around bunches, and returns its radius.
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

// So many searches that follow each other are one part's: neighbours find each other's points in
// the cache.
constexpr std::size_t kSharedBunches = 16;

// The stars of bunches, and their influences, as messages between parts.
template <typename Cell>
void PackStars(std::span<const BallTree::Bunch> bunches, const Blocks<Cell>& stars,
               const double* influence, Peers::Bytes* message) {
  for (const BallTree::Bunch& bunch : bunches)
    for (const std::uint32_t p : std::span(bunch.ids, bunch.count)) {
      stars[p].PackTo(message);
      Pack(influence[p], message);
    }
}
template <typename Cell>
void UnpackStars(std::span<const BallTree::Bunch> bunches, Blocks<Cell>* stars, double* influence,
                 Parcel* parcel) {
  for (const BallTree::Bunch& bunch : bunches)
    for (const std::uint32_t p : std::span(bunch.ids, bunch.count)) {
      (*stars)[p].Unpack(parcel);
      parcel->Unpack(1, &influence[p]);
    }
}

// The largest size bound at the points of a bunch.
template <int K>
double LargestBound(const Sample<K>& sample, const BallTree::Bunch& bunch) {
  double most = 0;
  for (std::uint32_t i = 0; i < bunch.count; ++i)
    most = std::max(most, sample.BoundAt(bunch.ids[i]));
  return most;
}

// Builds p's star. `around` holds at least what lies within kSearched size bounds of p.
template <int K>
void BuildFromAround(const StarBuilder<K>& builder, const Site& p, PointsAround& around,
                     RestrictedVoronoiCell<K>* star) {
  const Sample<K>& sample = builder.sample();
  thread_local NearPoints near, beyond;
  const double bound = sample.BoundAt(p.id);
  const double gathered = kGathered * bound, searched = kSearched * bound;
  around.Part(p.id, sample.d(), gathered, searched, &near, &beyond);
  std::sort(near.begin(), near.end());
  const auto search = [&](double from, double to) {
    AppendBetween(sample.tree(), p.point, beyond, searched, from, to, &near);
  };
  builder.BuildFromNear(p, gathered, &near, search, star);
}

}  // namespace

template <int K>
void BulkStarBuilder<K>::Build(Blocks<Cell>* stars, double* influence) const {
  if constexpr (K == 2)
    if (builder_.options().centre_rule == CentreRule::kTangentSpace &&
        !sample_.has_protecting_balls())
      return BuildPolygons(stars, influence);
  const std::vector<BallTree::Bunch> bunches = sample_.tree().Bunches();
  const auto build = [&](std::size_t b) {
    thread_local std::vector<std::uint32_t> ids;
    thread_local PointsAround around;
    thread_local Cell cell;  // its memory is used again; what is kept is no larger than it must be
    const BallTree::Bunch& bunch = bunches[b];
    ids.clear();
    sample_.tree().GatherAround(bunch, kSearched * LargestBound(sample_, bunch), &ids);
    around.Take(ids, sample_.points(), sample_.d());
    for (const std::uint32_t p : std::span(bunch.ids, bunch.count)) {
      BuildFromAround(builder_, sample_.At(p), around, &cell);
      (*stars)[p] = cell;
      influence[p] = builder_.Influence(p, cell);
    }
  };
  ShareOut(
      peers_, bunches.size(), kSharedBunches, build,
      [&](std::size_t b, Peers::Bytes* message) {
        PackStars(std::span(&bunches[b], 1), *stars, influence, message);
      },
      [&](std::size_t b, Parcel* parcel) {
        UnpackStars(std::span(&bunches[b], 1), stars, influence, parcel);
      });
}

template <int K>
void BulkStarBuilder<K>::BuildPolygons(Blocks<Cell>* stars, double* influence) const {
  const std::vector<BallTree::Bunch> bunches = sample_.tree().Bunches();
  const std::vector<std::size_t> begins = CutIntoStretches(
      bunches, sample_.d(), [this](std::uint32_t p) { return sample_.BoundAt(p); });
  const auto stretch = [&](std::size_t i) {
    return std::span(bunches).subspan(begins[i], begins[i + 1] - begins[i]);
  };
  ShareOut(
      peers_, begins.size() - 1, kSharedBunches,
      [&](std::size_t i) { BuildPolygonsOf(stretch(i), stars, influence); },
      [&](std::size_t i, Peers::Bytes* message) {
        PackStars(stretch(i), *stars, influence, message);
      },
      [&](std::size_t i, Parcel* parcel) { UnpackStars(stretch(i), stars, influence, parcel); });
}

// One search serves all of them. The part that a bunch needs is copied: most of the time goes into
// finding which of these are near a point.
template <int K>
void BulkStarBuilder<K>::BuildPolygonsOf(std::span<const BallTree::Bunch> bunches,
                                         Blocks<Cell>* stars, double* influence) const {
  thread_local std::vector<std::uint32_t> around;
  thread_local GatheredPoints gathered;
  thread_local std::vector<double> centre;
  const double radius = BallAround(bunches, sample_.d(), &centre);
  double most = 0;
  for (const BallTree::Bunch& bunch : bunches) most = std::max(most, LargestBound(sample_, bunch));
  around.clear();
  sample_.tree().Gather(centre.data(), kRounding * (radius + kPolygonFar * most), &around);
  for (const BallTree::Bunch& bunch : bunches) {
    Gather(around, sample_.points().data(), sample_.d(), bunch.centre,
           bunch.radius + kPolygonNear * most, &gathered);
    for (const std::uint32_t p : std::span(bunch.ids, bunch.count)) {
      const Site site = sample_.At(p);
      influence[p] = site.walls != 0 ? BuildOnWalls(site, around, &(*stars)[p])
                                     : BuildPolygon(site, gathered, around, &(*stars)[p]);
    }
  }
}

// Builds the star of a point on walls, and returns its influence.
template <int K>
double BulkStarBuilder<K>::BuildOnWalls(const Site& p, const std::vector<std::uint32_t>& ids,
                                        Cell* star) const {
  thread_local PointsAround around;
  thread_local Cell cell;
  around.Take(ids, sample_.points(), sample_.d());
  BuildFromAround(builder_, p, around, &cell);
  *star = cell;
  return builder_.Influence(p.id, cell);
}

// Builds the star of any other point, and returns its influence. `gathered`: all points within
// kPolygonNear size bounds of it, `around`: within kPolygonFar.
template <int K>
double BulkStarBuilder<K>::BuildPolygon(const Site& p, const GatheredPoints& gathered,
                                        const std::vector<std::uint32_t>& around,
                                        Cell* star) const {
  if constexpr (K != 2) {
    return 0;
  } else {
    thread_local std::vector<std::uint32_t> farther;
    thread_local GatheredPoints more;
    thread_local DraftPolygon polygon;
    const int d = sample_.d();
    const double weight = sample_.Weight(p.id), bound = sample_.BoundAt(p.id);
    const auto search = [&](double reach) {
      const bool is_near = reach <= kPolygonFar * bound;
      farther.clear();
      if (!is_near) sample_.tree().Gather(p.point, reach, &farther);
      Gather(is_near ? around : farther, sample_.points().data(), d, p.point, reach, &more);
      return &more;
    };
    polygon.Reset(builder_.options().inradius);
    const double influence = CutNearestFirst(
        p.point, d, &gathered, kPolygonNear * bound,
        [&] { return StarBuilder<K>::InfluenceWithin(polygon.max_norm2()); },
        [&](std::uint32_t q) {
          return q != p.id && polygon.ClipBy(q, d, p.point, p.tangent, weight, sample_.Point(q),
                                             sample_.Weight(q));
        },
        search);
    star->Take(polygon);
    return influence;
  }
}

STELLATE_INSTANTIATE_CLASS(BulkStarBuilder)

}  // namespace stellate::core
