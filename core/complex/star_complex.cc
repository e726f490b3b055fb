#include "core/complex/star_complex.h"

#include <algorithm>
#include <utility>

#include "core/base/basis_layout.h"
#include "core/base/parallel.h"
#include "core/complex/around.h"

namespace stellate::core {
namespace {

// The point itself, and as many neighbours as close a cell.
template <int K>
inline constexpr int kNearestFirst = 2 * K + 3;

// Far above what rounding leaves of tangent bases and inner products, far below any distance that
// matters: the share of a length by which a bound on its part off the tangent space is larger.
constexpr double kOffRounding = 1e-10;
double LengthOff(double whole2, double along2) {
  return std::sqrt(std::max(whole2 - along2, 0.0) + kOffRounding * whole2);
}

// The vertices of a judged cell, by coordinate: their places in T_pM, and how far their centres are
// off it. A half-space of R^d is held against them all at once in T_pM, where that is enough.
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

  // What step . c can be at most, by vertex: `normal` is the part of `step` along T_pM, `off` the
  // length of the rest. Returns whether one is above `offset`.
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

}  // namespace

template <int K>
StarComplex<K>::StarComplex(int d, double epsilon, double inradius, Judging judging)
    : d_(d),
      inradius_(inradius),
      judging_(judging),
      judged_radius2_(kJudgedRadius * kJudgedRadius * epsilon * epsilon),
      weight_scale_(1e-10 * epsilon * epsilon),
      tree_(d, &points_),
      boundary_tree_(d, &boundary_points_) {}

template <int K>
StarComplex<K>::StarComplex(const StarComplex& other)
    : d_(other.d_),
      inradius_(other.inradius_),
      judging_(other.judging_),
      judged_radius2_(other.judged_radius2_),
      weight_scale_(other.weight_scale_),
      points_(other.points_),
      tangents_(other.tangents_),
      names_(other.names_),
      walls_(other.walls_),
      conormals_at_(other.conormals_at_),
      conormals_(other.conormals_),
      guards_(other.guards_),
      largest_guard_(other.largest_guard_),
      cells_(other.cells_),
      tree_(other.tree_, &points_),
      boundary_(other.boundary_),
      boundary_points_(other.boundary_points_),
      boundary_tree_(other.boundary_tree_, &boundary_points_),
      faces_alone_(other.faces_alone_),
      becomes_whole_(other.becomes_whole_),
      simplex_count_(other.simplex_count_) {}

template <int K>
double StarComplex<K>::Project(std::uint32_t p, const double* q, double* normal) const {
  Step step(d_);
  return Project(At(p), q, step.data(), normal);
}

template <int K>
double StarComplex<K>::Project(const Site& p, const double* q, double* step, double* normal) const {
  return WithDimension(d_, [&](auto known) {
    const int d = known() > 0 ? known() : d_;
    for (int i = 0; i < d; ++i) step[i] = q[i] - p.point[i];
    for (int a = 0; a < K; ++a) normal[a] = Dot(p.tangent + a * d, step, d);
    return Dot(step, step, d);
  });
}

template <int K>
void StarComplex<K>::Lift(std::uint32_t p, const double* x, double* point) const {
  const double* at = Point(p);
  const double* tangent = Tangent(p);
  for (int i = 0; i < d_; ++i) {
    double s = at[i];
    for (int a = 0; a < K; ++a) s += x[a] * tangent[a * d_ + i];
    point[i] = s;
  }
}

template <int K>
double StarComplex<K>::HalfSpace(std::uint32_t p, std::size_t facet, double* normal) const {
  if constexpr (K == 2) {
    const Site site = At(p);
    return Around(*this, site, nullptr).HalfSpace(cells_[p].id(facet), normal);
  } else {
    std::copy_n(cells_[p].normal(facet), K, normal);
    return cells_[p].offset(facet);
  }
}

template <int K>
double StarComplex<K>::EdgeLength2(std::uint32_t p, std::size_t facet) const {
  if constexpr (K == 2)
    return SquaredDistance(Point(p), Point(cells_[p].id(facet)), d_);
  else
    return 2 * cells_[p].offset(facet) - GuardOf(p) + GuardOf(cells_[p].id(facet));
}

template <int K>
bool StarComplex<K>::ClipBy(Cell& cell, const Site& p, const Site& q, const Site* guest,
                            const Cell* born, typename Cell::Scratch& scratch) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  const Around around(*this, p, guest, &q, born);
  return cell.Clip(q.id, normal, offset, scratch, around, step.data());
}

template <int K>
bool StarComplex<K>::Cuts(const Cell& cell, const Site& p, const Site& q) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return cell.WouldCut(normal, offset, step.data());
}

template <int K>
void StarComplex<K>::ResetInFlats(Cell& cell, const Site& p) const {
  cell.Reset(inradius_, Around(*this, p, Judging::kFlats));
}

template <int K>
bool StarComplex<K>::ClipInFlats(Cell& cell, const Site& p, const Site& q,
                                 typename Cell::Scratch& scratch) const {
  Step step(d_);
  double normal[K];
  const double offset = HalfSpace(p, q, step.data(), normal);
  return cell.Clip(q.id, normal, offset, scratch, Around(*this, p, Judging::kFlats));
}

template <int K>
bool StarComplex<K>::JudgeCell(Cell& cell, const Site& p, const Near& near) const {
  if constexpr (K == 2) {
    return false;
  } else {
    cell.Judge(Around(*this, p, judging_));
    if (near.empty()) return true;
    thread_local JudgedPlaces<K> places;
    places.Take(cell);
    const double reach = Influence(p.id, cell), weight = Weight(p.id);
    // Of what is on q's own facet rounding decides.
    const auto is_off = [&](std::size_t v, std::uint32_t q) {
      for (int s = 0; s < K; ++s)
        if (cell.id(cell.facet(v, s)) == q) return false;
      return true;
    };
    Step step(d_);
    double normal[K];
    for (const auto& [distance2, q] : near) {
      if (distance2 > reach * reach) break;
      const double length2 = Project(p, Point(q), step.data(), normal);
      const double offset = 0.5 * (length2 + weight - Weight(q));
      if (!places.Bound(normal, LengthOff(length2, Dot(normal, normal, K)), offset)) continue;
      for (std::size_t v = 0; v < cell.vertex_count(); ++v)
        if (places.bound(v) > offset && is_off(v, q) &&
            cell.WouldCutVertex(v, normal, offset, step.data()))
          return false;
    }
    return true;
  }
}

template <int K>
int StarComplex<K>::Nearest(const double* q, int count,
                            std::pair<double, std::uint32_t>* nearest) const {
  int found = 0;
  tree_.VisitNear(
      q, [&] { return found < count ? INFINITY : std::sqrt(nearest[count - 1].first); },
      [&](std::uint32_t id, double distance2) {
        const std::pair<double, std::uint32_t> candidate{distance2, id};
        if (found == count && !(candidate < nearest[count - 1])) return;
        int at = found < count ? found++ : count - 1;
        for (; at > 0 && candidate < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
        nearest[at] = candidate;
      });
  return found;
}

// The sample points that most likely close a cell around q, the nearest first: those nearest, or,
// where a star near q is known, that star and the stars of its points nearest to q.
template <int K>
void StarComplex<K>::Neighbourhood(const double* q, std::uint32_t near,
                                   std::vector<std::uint32_t>* ids) const {
  ids->clear();
  constexpr int kCount = kNearestFirst<K>;
  std::array<std::pair<double, std::uint32_t>, kCount> nearest;
  if (near == kNone || !cells_[near].bounded()) {
    const int count = Nearest(q, kCount, nearest.data());
    for (int i = 0; i < count; ++i) ids->push_back(nearest[static_cast<std::size_t>(i)].second);
    return;
  }
  int count = 0;
  const auto offer = [&](std::uint32_t id) {
    const std::pair<double, std::uint32_t> candidate{SquaredDistance(q, Point(id), d_), id};
    if (count == K + 1 && !(candidate < nearest[K])) return;
    int at = count < K + 1 ? count++ : K;
    for (; at > 0 && candidate < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
    nearest[at] = candidate;
  };
  offer(near);
  for (std::size_t f = 0; f < cells_[near].facet_count(); ++f)
    if (IsSample(cells_[near].id(f))) offer(cells_[near].id(f));
  const auto add = [&](std::uint32_t id) {
    if (IsSample(id) && std::find(ids->begin(), ids->end(), id) == ids->end()) ids->push_back(id);
  };
  for (int i = 0; i < count; ++i) ids->push_back(nearest[i].second);
  for (int i = 0; i < count; ++i) {
    const Cell& cell = cells_[nearest[i].second];
    for (std::size_t f = 0; f < cell.facet_count(); ++f) add(cell.id(f));
  }
}

template <int K>
bool StarComplex<K>::CutsVertex(std::uint32_t p, std::size_t vertex, const double* point) const {
  Step step(d_);
  double normal[K];
  const Site site = At(p);
  const double offset = 0.5 * (Project(site, point, step.data(), normal) + GuardOf(p));
  return cells_[p].WouldCutVertex(vertex, normal, offset, step.data());
}

template <int K>
void StarComplex<K>::ResetCell(Cell& cell, const Site& p, const Site* guest,
                               typename Cell::Scratch& scratch) const {
  const Around around(*this, p, guest);
  cell.Reset(inradius_, around);
  if (p.walls == 0) return;
  Step step(d_);
  const double* conormal = p.conormals;
  ForEachWall(p.walls, [&](int wall) {
    around.Lift(conormal, step.data());
    cell.Clip(IdOfWall(wall), conormal, kWallOffset * inradius_, scratch, around, step.data());
    conormal += K;
  });
}

template <int K>
bool StarComplex<K>::AnyWithin(const double* q, double radius) const {
  return tree_.AnyWithin(q, radius);
}

template <int K>
std::vector<std::uint32_t> StarComplex<K>::Simplices() const {
  return ParallelGather<std::uint32_t>(cells_.size(), [&](std::size_t p, auto* all) {
    thread_local std::vector<Simplex> owned;
    owned.clear();
    ForEachOwned(static_cast<std::uint32_t>(p),
                 [&](std::size_t, const Simplex& s) { owned.push_back(s); });
    std::sort(owned.begin(), owned.end());
    for (const Simplex& s : owned) all->insert(all->end(), s.begin(), s.end());
  });
}

template <int K>
Eigen::MatrixXd StarComplex<K>::TangentMatrix() const {
  Eigen::MatrixXd matrix(d_ * K, size());
  for (std::uint32_t p = 0; p < size(); ++p)
    ToByCoordinate(Tangent(p), d_, K, matrix.col(p).data());
  return matrix;
}

STELLATE_INSTANTIATE_CLASS(StarComplex)

}  // namespace stellate::core
