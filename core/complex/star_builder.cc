#include "core/complex/star_builder.h"

#include "core/complex/star_surroundings.h"
#include "core/geometry/draft_polygon.h"
#include "core/geometry/draft_polytope.h"

namespace stellate::core {
namespace {

// The neighbours of a new point are gathered this much farther than its star in the tangent space
// reaches: few judged stars are larger than that.
constexpr double kJudgedReach = 1.1;
// ... and up to this distance, in epsilon: a star that is still open would gather half of the
// sample.
constexpr double kFarthest = 5;
// A star is cut by all points this near, in epsilon, before it is known how far it reaches.
constexpr double kAtFirst = 2;

// Far above what rounding leaves of tangent bases and inner products, far below any distance that
// matters: the share of a length by which a bound on its part off the tangent space is larger.
constexpr double kOffRounding = 1e-10;
double LengthOff(double whole2, double along2) {
  return std::sqrt(std::max(whole2 - along2, 0.0) + kOffRounding * whole2);
}

// The vertices of a judged cell, by coordinate: their places in T_pM, and how far their centres are
// off it. A half-space of R^d is compared with all of them in one pass in T_pM, if that decides.
template <int K>
class JudgedPlaces {
 public:
  void Take(const RestrictedVoronoiCell<K>& cell) {
    count_ = cell.vertex_count();
    places_.resize(K * count_);
    off_.resize(count_);
    bounds_.resize(count_);
    for (std::size_t v = 0; v < count_; ++v) {
      for (std::size_t a = 0; a < K; ++a) places_[a * count_ + v] = cell.x(v)[a];
      off_[v] = LengthOff(cell.norm2(v), Dot(cell.x(v), cell.x(v), K));
    }
  }

  // Bounds step . c from above, by vertex: `normal` is the part of `step` along T_pM, `off` the
  // length of the rest. Returns whether one bound is above `offset`.
  bool Bound(const double* normal, double off, double offset) {
    const double* const places = places_.data();
    const double* const off_flat = off_.data();
    double* const bounds = bounds_.data();
    const std::size_t count = count_;
    std::size_t above = 0;
    for (std::size_t v = 0; v < count; ++v) {
      double bound = off * off_flat[v];
      for (std::size_t a = 0; a < K; ++a) bound += normal[a] * places[a * count + v];
      bounds[v] = bound;
      above += bound > offset;
    }
    return above > 0;
  }
  double bound(std::size_t v) const { return bounds_[v]; }

 private:
  std::size_t count_ = 0;
  std::vector<double> places_, off_, bounds_;
};

// Cuts by the near points, nearest first and ties by id, as far as points can cut. `near` holds all
// points within `known`, sorted; search(from, to) appends those between. Returns the distance
// within which all points are known in the end.
template <typename Reach, typename Clip, typename Search>
double CutByNear(double known, NearPoints* near, const Reach& reach, const Clip& clip,
                 const Search& search) {
  for (std::size_t next = 0;;) {
    double far = reach();
    for (; next < near->size() && (*near)[next].first <= far * far; ++next)
      if (clip((*near)[next].second)) far = reach();
    if (far <= known) return known;
    const double farther = std::min(far, 2 * known);
    search(known, farther);
    std::sort(near->begin() + static_cast<std::ptrdiff_t>(next), near->end());
    known = farther;
  }
}

// A point q in the tangent coordinates of p, T_p^t (q - p), and the half-space of its bisector.
template <int K>
struct Projected {
  double normal[K];
  double length2, offset;  // of q - p; of the half-space
};

template <int K>
Projected<K> ProjectPoint(const Sample<K>& sample, const Site& p, double weight, std::uint32_t q,
                          double* step) {
  Projected<K> projected;
  projected.length2 = sample.Project(p, sample.Point(q), step, projected.normal);
  projected.offset = 0.5 * (projected.length2 + weight - sample.Weight(q));
  return projected;
}

// Those of a thread's last cell in the tangent space, by place in the near points.
template <int K>
std::vector<Projected<K>>& ThreadProjected() {
  thread_local std::vector<Projected<K>> projected;
  return projected;
}

bool Contains(std::span<const std::uint32_t> ids, std::uint32_t id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

// One for each thread.
DraftPolygon& BuilderPolygon() {
  thread_local DraftPolygon polygon;
  return polygon;
}

}  // namespace

template <int K>
typename StarBuilder<K>::Cell::Scratch& StarBuilder<K>::ThreadScratch() {
  thread_local typename Cell::Scratch scratch;
  return scratch;
}

template <int K>
double StarBuilder<K>::HalfSpace(const Site& p, std::uint32_t id, double* normal) const {
  return StarSurroundings<K>(*this, p, options_.centre_rule).HalfSpace(id, normal);
}

template <int K>
bool StarBuilder<K>::Clip(const Site& p, const Site& q, const Cell* born, Cell* star) const {
  Step step(sample_.d());
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  const StarSurroundings<K> around(*this, p, options_.centre_rule, &q, born);
  return star->Clip(q.id, normal, offset, ThreadScratch(), around, step.data());
}

template <int K>
bool StarBuilder<K>::IsCutBy(const Cell& star, const Site& p, const Site& q) const {
  Step step(sample_.d());
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return star.WouldCut(normal, offset, step.data());
}

template <int K>
void StarBuilder<K>::Cut(const Site& p, std::span<const StarCut> cuts, const Blocks<Cell>& stars,
                         Cell* star) const {
  if constexpr (K == 2)
    if (options_.centre_rule == CentreRule::kTangentSpace && p.walls == 0)
      return CutPolygon(p, cuts, star);
  for (const StarCut& cut : cuts) Clip(p, sample_.At(cut.by), &stars[cut.by], star);
}

// The half-spaces of facets next to a cut are computed when they are needed, once each.
template <int K>
void StarBuilder<K>::CutPolygon(const Site& p, std::span<const StarCut> cuts, Cell* star) const {
  if constexpr (K == 2) {
    DraftPolygon& polygon = BuilderPolygon();
    const int d = sample_.d();
    const double weight = sample_.Weight(p.id);
    const auto half_space = [&](std::uint32_t q, double* normal) {
      if (IsFake(q))
        return FakeHalfSpace<2>(static_cast<int>(q - kFirstFakeId), options_.inradius, normal);
      return polygon.HalfSpace(d, p.point, p.tangent, weight, sample_.Point(q), sample_.Weight(q),
                               normal);
    };
    polygon.Resume(*star);
    for (const StarCut& cut : cuts)
      polygon.ClipBy(cut.by, d, p.point, p.tangent, weight, sample_.Point(cut.by),
                     sample_.Weight(cut.by), half_space);
    star->Take(polygon);
  }
}

// The cell before any other point is known.
template <int K>
void StarBuilder<K>::Reset(const Site& p, Cell* star) const {
  const StarSurroundings<K> around(*this, p, options_.centre_rule);
  star->Reset(options_.inradius, around);
  if (p.bounds == 0) return;
  Step step(sample_.d());
  ForEachWall(p.bounds, [&](int wall) {
    double outward[K];
    const double offset = around.HalfSpace(IdOfWall(wall), outward);
    around.Lift(outward, step.data());
    star->Clip(IdOfWall(wall), outward, offset, ThreadScratch(), around, step.data());
  });
}

// The same for a cell that is judged at common centres only when it is complete.
template <int K>
void StarBuilder<K>::ResetInTangentSpace(const Site& p, Cell* star) const {
  star->Reset(options_.inradius, StarSurroundings<K>(*this, p, CentreRule::kTangentSpace));
}

template <int K>
bool StarBuilder<K>::ClipInTangentSpace(const Site& p, const Site& q, Cell* star) const {
  Step step(sample_.d());
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return star->Clip(q.id, normal, offset, ThreadScratch(),
                    StarSurroundings<K>(*this, p, CentreRule::kTangentSpace));
}

// Clips a draft in the tangent space.
template <int K>
template <typename Polytope>
bool StarBuilder<K>::ClipApart(const Site& p, std::uint32_t q, double* step,
                               Polytope* polytope) const {
  double normal[K];
  const double offset = HalfSpace(p, sample_.At(q), step, normal);
  return polytope->Clip(q, normal, offset);
}

// Judges a cell that was built in the tangent space. Returns whether it has the same vertices at
// common centres: none of `near`, the points within reach, is nearer to a common centre than the
// simplex's own. So many of them are the thread's projected ones.
template <int K>
bool StarBuilder<K>::Judge(const Site& p, const NearPoints& near, std::size_t projected,
                           Cell* star) const {
  if constexpr (K == 2) {
    return false;
  } else {
    star->Judge(StarSurroundings<K>(*this, p, options_.centre_rule));
    if (near.empty()) return true;
    thread_local JudgedPlaces<K> places;
    places.Take(*star);
    const std::span<const Projected<K>> known(ThreadProjected<K>().data(), projected);
    const double reach = Influence(p.id, *star), weight = sample_.Weight(p.id);
    const auto project = [&](std::uint32_t q, double* step) {
      return ProjectPoint<K>(sample_, p, weight, q, step);
    };
    // Whether v is on q's own facet is left to rounding.
    const auto is_off = [&](std::size_t v, std::uint32_t q) {
      for (int s = 0; s < K; ++s)
        if (star->id(star->facet(v, s)) == q) return false;
      return true;
    };
    Step step(sample_.d());
    for (std::size_t i = 0; i < near.size() && near[i].first <= reach * reach; ++i) {
      const std::uint32_t q = near[i].second;
      const Projected<K> to = i < known.size() ? known[i] : project(q, step.data());
      if (!places.Bound(to.normal, LengthOff(to.length2, Dot(to.normal, to.normal, K)), to.offset))
        continue;
      for (std::size_t v = 0; v < star->vertex_count(); ++v) {
        if (!(places.bound(v) > to.offset) || !is_off(v, q)) continue;
        if (i < known.size()) project(q, step.data());  // for the step
        if (star->WouldCutVertex(v, to.normal, to.offset, step.data())) return false;
      }
    }
    return true;
  }
}

template <int K>
double StarBuilder<K>::MaxNorm2OnFaces(const Cell& star) {
  double most2 = 0;
  for (std::size_t v = 0; v < star.vertex_count(); ++v)
    if (star.norm2(v) > most2 && WallsAt<K>(star, v) != 0) most2 = star.norm2(v);
  return most2 > 0 ? most2 : star.max_norm2();  // the point is inside: the whole star
}

// At common centres, cuts that would leave no polytope are refused, and a cell may stay open in the
// middle of the sample, where R1 would add points forever. Such a cell is closed in the tangent
// space instead, and judged: if that is not the cell at common centres, stars disagree, which R4
// resolves.
template <int K>
void StarBuilder<K>::CloseInTangentSpace(const Site& p, Cell* star) const {
  const bool has_joined = p.id < sample_.size();
  if (K < 3 || !has_joined || options_.centre_rule != CentreRule::kCommonCentre || p.walls != 0 ||
      star->bounded())
    return;
  thread_local Cell flat;
  ResetInTangentSpace(p, &flat);
  sample_.tree().VisitNear(
      p.point, [&] { return Influence(p.id, flat); },
      [&](std::uint32_t q, double) {
        if (q != p.id) ClipInTangentSpace(p, sample_.At(q), &flat);
      });
  if (!flat.bounded()) return;
  Judge(p, {}, 0, &flat);
  *star = flat;
}

// Clips by `first`, and then by all points that can cut, in the order in which the search tree
// finds them. Each point cuts once: rounding would decide a second cut by the same plane.
template <int K>
template <typename Reach, typename ClipBy>
void StarBuilder<K>::ClipAsFound(const Site& p, std::span<const std::uint32_t> first,
                                 const Reach& reach_now, const ClipBy& clip,
                                 std::vector<std::uint32_t>* influenced) const {
  for (const std::uint32_t q : first)
    if (q != p.id) clip(q);
  double reach = reach_now();
  sample_.tree().VisitAround(
      p.point, [&] { return reach; },
      [&](std::uint32_t q, double) {
        if (q == p.id || Contains(first, q)) return;
        if (clip(q)) reach = reach_now();
      },
      [&](std::uint32_t q) { influenced->push_back(q); });
}

template <int K>
void StarBuilder<K>::BuildAsFound(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                                  std::vector<std::uint32_t>* influenced) const {
  Reset(p, star);
  ClipAsFound(
      p, first, [&] { return Influence(p.id, *star); },
      [&](std::uint32_t q) { return Clip(p, sample_.At(q), nullptr, star); }, influenced);
  CloseInTangentSpace(p, star);
}

template <int K>
void StarBuilder<K>::BuildPolygon(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                                  std::vector<std::uint32_t>* influenced) const {
  if constexpr (K == 2) {
    DraftPolygon& polygon = BuilderPolygon();
    const double weight = sample_.Weight(p.id);
    polygon.Reset(options_.inradius);
    ClipAsFound(
        p, first, [&] { return InfluenceWithin(polygon.max_norm2()); },
        [&](std::uint32_t q) {
          return polygon.ClipBy(q, sample_.d(), p.point, p.tangent, weight, sample_.Point(q),
                                sample_.Weight(q));
        },
        influenced);
    star->Take(polygon);
  }
}

// Returns false if the polytope gave up.
template <int K>
bool StarBuilder<K>::BuildPolytope(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                                   std::vector<std::uint32_t>* influenced) const {
  if constexpr (K != 3) {
    return false;
  } else {
    DraftPolytope& polytope = ThreadPolytope();
    Step step(sample_.d());
    polytope.Reset(options_.inradius);
    ClipAsFound(
        p, first, [&] { return InfluenceWithin(polytope.max_norm2()); },
        [&](std::uint32_t q) { return ClipApart(p, q, step.data(), &polytope); }, influenced);
    if (polytope.gave_up()) return false;
    star->Take(polytope);
    return true;
  }
}

// Returns false if that is not the star, which depends only on the points around p.
template <int K>
bool StarBuilder<K>::BuildAsInTangentSpace(const Site& p, std::span<const std::uint32_t> first,
                                           Cell* star,
                                           std::vector<std::uint32_t>* influenced) const {
  if constexpr (K != 3) {
    return false;
  } else {
    DraftPolytope& polytope = ThreadPolytope();
    thread_local NearPoints around;
    Step step(sample_.d());
    polytope.Reset(options_.inradius);
    const auto clip = [&](std::uint32_t q) { ClipApart(p, q, step.data(), &polytope); };
    for (const std::uint32_t q : first)
      if (q != p.id) clip(q);
    const auto judged_reach = [&] { return kJudgedReach * Influence(p.id, polytope.max_norm2()); };
    const double farthest = kFarthest * sample_.epsilon();
    const double gathered = std::min(judged_reach(), farthest);
    around.clear();
    sample_.tree().VisitAround(
        p.point, [&] { return gathered; },
        [&](std::uint32_t q, double distance2) {
          if (q != p.id) around.emplace_back(distance2, q);
        },
        [&](std::uint32_t q) { influenced->push_back(q); });
    std::sort(around.begin(), around.end());
    for (const auto& [distance2, q] : around)
      if (!Contains(first, q)) clip(q);
    const double reach = judged_reach();
    if (polytope.gave_up() || reach > farthest) return false;
    star->Take(polytope);
    return Judge(p, around, 0, star) && Influence(p.id, *star) <= reach;
  }
}

template <int K>
void StarBuilder<K>::BuildNearestFirst(const Site& p, Cell* star) const {
  thread_local NearPoints near;
  near.clear();
  const auto search = [&](double from, double to) {
    sample_.tree().VisitNear(
        p.point, [&] { return to; },
        [&](std::uint32_t q, double distance2) {
          if (q != p.id && (distance2 > from * from || from == 0)) near.emplace_back(distance2, q);
        });
  };
  const double known = kAtFirst * sample_.epsilon();
  search(0, known);
  std::sort(near.begin(), near.end());
  BuildNearestFirst(p, known, &near, search, star);
}

template <int K>
void StarBuilder<K>::BuildNearestFirst(const Site& p, double known, NearPoints* near,
                                       const Search& search, Cell* star) const {
  Reset(p, star);
  CutByNear(
      known, near, [&] { return Influence(p.id, *star); },
      [&](std::uint32_t q) { return Clip(p, sample_.At(q), nullptr, star); }, search);
  CloseInTangentSpace(p, star);
}

template <int K>
void StarBuilder<K>::Build(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                           std::vector<std::uint32_t>* influenced) const {
  influenced->clear();
  if (p.walls != 0) return BuildAsFound(p, first, star, influenced);
  const bool in_tangent_space = options_.centre_rule == CentreRule::kTangentSpace;
  if constexpr (K == 2) {
    const bool has_joined = p.id < sample_.size();
    if (in_tangent_space && has_joined && !sample_.has_protecting_balls())
      return BuildPolygon(p, first, star, influenced);
  }
  if constexpr (K == 3) {
    if (!in_tangent_space && !options_.boundary_only) {
      if (!BuildAsInTangentSpace(p, first, star, influenced)) BuildNearestFirst(p, star);
      return;
    }
    if (in_tangent_space && !options_.boundary_only && !sample_.has_protecting_balls()) {
      if (BuildPolytope(p, first, star, influenced)) return;
      influenced->clear();
    }
  }
  BuildAsFound(p, first, star, influenced);
}

// Builds the cell in the tangent space. Afterwards `near` holds all points within `known`. Returns
// how many of them are the thread's projected ones.
template <int K>
std::size_t StarBuilder<K>::CutInTangentSpace(const Site& p, double* known, NearPoints* near,
                                              const Search& search, Cell* star) const {
  if constexpr (K == 3) {
    DraftPolytope& polytope = ThreadPolytope();
    std::vector<Projected<K>>& projected = ThreadProjected<K>();
    projected.clear();
    const double weight = sample_.Weight(p.id);
    Step step(sample_.d());
    polytope.Reset(options_.inradius);
    *known = CutByNear(
        *known, near, [&] { return Influence(p.id, polytope.max_norm2()); },
        [&](std::uint32_t q) {
          projected.push_back(ProjectPoint<K>(sample_, p, weight, q, step.data()));
          return polytope.Clip(q, projected.back().normal, projected.back().offset);
        },
        search);
    if (!polytope.gave_up()) {
      star->Take(polytope);
      return projected.size();
    }
  }
  ResetInTangentSpace(p, star);
  *known = CutByNear(
      *known, near, [&] { return Influence(p.id, *star); },
      [&](std::uint32_t q) { return ClipInTangentSpace(p, sample_.At(q), star); }, search);
  return 0;
}

// Most stars are the same in the tangent space, where clips cost a fraction. Returns false if this
// one is not, and must be judged at each cut.
template <int K>
bool StarBuilder<K>::BuildInTangentSpace(const Site& p, double* known, NearPoints* near,
                                         const Search& search, Cell* star) const {
  const std::size_t projected = CutInTangentSpace(p, known, near, search, star);
  return Judge(p, *near, projected, star) && Influence(p.id, *star) <= *known;
}

template <int K>
void StarBuilder<K>::BuildFromNear(const Site& p, double known, NearPoints* near,
                                   const Search& search, Cell* star) const {
  if (K > 2 && options_.centre_rule == CentreRule::kCommonCentre && p.walls == 0 &&
      BuildInTangentSpace(p, &known, near, search, star))
    return;
  BuildNearestFirst(p, known, near, search, star);
}

STELLATE_INSTANTIATE_CLASS(StarBuilder)

}  // namespace stellate::core
