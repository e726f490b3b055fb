#include "core/complex/star_complex.h"

#include <algorithm>
#include <iterator>

#include "core/geometry/common_centre.h"
#include "core/parallel.h"

namespace stellate::core {

namespace {

// The point itself, and as many neighbours as close a cell.
template <int K>
inline constexpr int kNearestFirst = 2 * K + 3;

// Simplices of a larger circumradius, in epsilon, are judged in the flats: far out the common centre
// is no better, and they will be refined anyway.
constexpr double kJudgedRadius = 1.3;

// One a thread, for the life of the thread.
template <int K>
typename RestrictedVoronoiCell<K>::Scratch& ThreadScratch() {
  thread_local typename RestrictedVoronoiCell<K>::Scratch scratch;
  return scratch;
}

// Room for q - p, on the stack where d is small.
class Step {
 public:
  explicit Step(int d) {
    if (d > kSmall) heap_.resize(static_cast<std::size_t>(d));
  }
  double* data() { return heap_.empty() ? stack_ : heap_.data(); }

 private:
  static constexpr int kSmall = 16;
  double stack_[kSmall];
  std::vector<double> heap_;
};

}  // namespace

template <int K>
StarComplex<K>::StarComplex(int d, double epsilon, double inradius, Judging judging)
    : d_(d),
      inradius_(inradius),
      judging_(judging),
      judged_radius2_(kJudgedRadius * kJudgedRadius * epsilon * epsilon),
      weight_scale_(1e-10 * epsilon * epsilon),
      tree_(d, &points_) {}

// Judges the vertices of one cell, p's.
template <int K>
class StarComplex<K>::CentreJudge final : public Cell::Judge {
 public:
  CentreJudge(const StarComplex& complex, const Site& p, const Site* guest)
      : complex_(complex), p_(p), guest_(guest) {}

  int d() const override { return complex_.d_; }

  void Centre(const Cell& cell, Vertex& v, double* centre) const override {
    const int n = d();
    if (!Common(cell, v, centre)) {
      std::fill(centre, centre + n, 0.0);
      for (int a = 0; a < K; ++a)
        for (int i = 0; i < n; ++i) centre[i] += v.x[a] * p_.tangent[a * n + i];
      return;
    }
    v.norm2 = Dot(centre, centre, n);
    for (int a = 0; a < K; ++a) v.x[a] = Dot(p_.tangent + a * n, centre, n);
  }

 private:
  bool Common(const Cell& cell, const Vertex& v, double* centre) const {
    std::uint32_t ids[K + 1];
    ids[0] = p_.id;
    for (int s = 0; s < K; ++s) {
      ids[s + 1] = cell.facets()[v.facet[s]].id;
      if (IsFake(ids[s + 1])) return false;
    }
    std::sort(ids, ids + K + 1);
    const double* points[K + 1];
    const double* tangents[K + 1];
    double weights[K + 1];
    for (int i = 0; i <= K; ++i) {
      const Site site = ids[i] == p_.id                  ? p_
                        : guest_ && ids[i] == guest_->id ? *guest_
                                                         : complex_.At(ids[i]);
      points[i] = site.point;
      tangents[i] = site.tangent;
      weights[i] = complex_.Weight(site.id);
    }
    double radius2;
    if (!CommonCentre<K>(d(), points, tangents, weights, centre, &radius2)) return false;
    if (radius2 > complex_.judged_radius2_) return false;
    for (int i = 0; i < d(); ++i) centre[i] += points[0][i] - p_.point[i];
    return true;
  }

  const StarComplex& complex_;
  const Site& p_;
  const Site* guest_;
};

template <int K>
double StarComplex<K>::Project(const Site& p, const double* q, double* step, double* normal) const {
  for (int i = 0; i < d_; ++i) step[i] = q[i] - p.point[i];
  for (int a = 0; a < K; ++a) normal[a] = Dot(p.tangent + a * d_, step, d_);
  return Dot(step, step, d_);
}

template <int K>
double StarComplex<K>::Project(std::uint32_t p, const double* q, double* normal) const {
  Step step(d_);
  return Project(At(p), q, step.data(), normal);
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
bool StarComplex<K>::ClipBy(Cell& cell, const Site& p, const Site& q, const Site* guest,
                            typename Cell::Scratch& scratch) const {
  Step step(d_);
  double normal[K];
  const double distance2 = Project(p, q.point, step.data(), normal);
  const double offset = 0.5 * (distance2 + Weight(p.id) - Weight(q.id));
  if (judging_ == Judging::kFlats) return cell.Clip(q.id, normal, offset, scratch);
  const CentreJudge judge(*this, p, guest);
  return cell.Clip(q.id, normal, offset, scratch, &judge, step.data());
}

template <int K>
bool StarComplex<K>::Cuts(const Cell& cell, const Site& p, const Site& q) const {
  Step step(d_);
  double normal[K];
  const double distance2 = Project(p, q.point, step.data(), normal);
  const double offset = 0.5 * (distance2 + Weight(p.id) - Weight(q.id));
  if (judging_ == Judging::kFlats) return cell.WouldCut(normal, offset);
  const CentreJudge judge(*this, p, nullptr);
  return cell.WouldCut(normal, offset, &judge, step.data());
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

template <int K>
bool StarComplex<K>::CutsVertex(std::uint32_t p, std::size_t vertex, const double* point) const {
  Step step(d_);
  double normal[K];
  const Site site = At(p);
  const double offset = 0.5 * Project(site, point, step.data(), normal);
  if (judging_ == Judging::kFlats) return cells_[p].WouldCutVertex(vertex, normal, offset);
  const CentreJudge judge(*this, site, nullptr);
  return cells_[p].WouldCutVertex(vertex, normal, offset, &judge, step.data());
}

template <int K>
template <typename Influencing>
void StarComplex<K>::BuildStar(const Site& p, const Site* guest, Cell& cell,
                               typename Cell::Scratch& scratch,
                               const Influencing& influencing) const {
  if (judging_ == Judging::kFlats) {
    cell.Reset(inradius_);
  } else {
    const CentreJudge judge(*this, p, guest);
    cell.Reset(inradius_, &judge);
  }
  // The nearest points close the cell, or nearly so: without them a search that happens to begin on
  // one side of p would visit all of that side while the cell is open towards the other.
  std::array<std::pair<double, std::uint32_t>, kNearestFirst<K>> nearest;
  const auto last = nearest.begin() + Nearest(p.point, kNearestFirst<K>, nearest.data());
  for (auto q = nearest.begin(); q != last; ++q)
    if (q->second != p.id) ClipBy(cell, p, At(q->second), guest, scratch);
  tree_.VisitAround(
      p.point, [&] { return Influence(cell); },
      [&](std::uint32_t q, double) {
        // Once by each point: a second cut by the same plane would be decided by rounding.
        const auto seen = std::find_if(nearest.begin(), last,
                                       [q](const auto& near) { return near.second == q; });
        if (q != p.id && seen == last) ClipBy(cell, p, At(q), guest, scratch);
      },
      influencing);
}

template <int K>
bool StarComplex<K>::SimplexOf(std::uint32_t p, const Cell& cell, const Vertex& v,
                               Simplex* simplex) const {
  (*simplex)[0] = p;
  for (int s = 0; s < K; ++s) {
    const std::uint32_t id = cell.facets()[v.facet[s]].id;
    if (IsFake(id)) return false;
    (*simplex)[static_cast<std::size_t>(s) + 1] = id;
  }
  std::sort(simplex->begin(), simplex->end());
  return true;
}

template <int K>
void StarComplex<K>::Owned(std::uint32_t p, std::vector<Simplex>* simplices) const {
  simplices->clear();
  Simplex s;
  for (const Vertex& v : cells_[p].vertices())
    if (SimplexOf(p, cells_[p], v, &s) && s[0] == p) simplices->push_back(s);
  std::sort(simplices->begin(), simplices->end());
}

template <int K>
std::uint32_t StarComplex<K>::Append(const double* point, const double* tangent) {
  const std::uint32_t id = size();
  points_.insert(points_.end(), point, point + d_);
  tangents_.insert(tangents_.end(), tangent, tangent + d_ * K);
  tree_.Insert(0);  // until Commit it is found by place, but has no influence
  return id;
}

template <int K>
bool StarComplex<K>::AnyWithin(const double* q, double radius) const {
  bool any = false;
  tree_.VisitNear(
      q, [&] { return any ? -1.0 : radius; }, [&](std::uint32_t, double) { any = true; });
  return any;
}

template <int K>
typename StarComplex<K>::Change StarComplex<K>::Commit(
    std::vector<std::uint32_t>* around) {
  const auto first = static_cast<std::uint32_t>(cells_.size());
  const std::uint32_t count = size() - first;
  Change change;
  if (count == 0) return change;
  cells_.resize(size());

  // Which old stars does each new point cut? Their influence is still that of before.
  std::vector<std::vector<std::uint32_t>> cut_by(count);
  ParallelFor(count, [&](std::uint32_t i) {
    const Site q = At(first + i);
    BuildStar(q, nullptr, cells_[q.id], ThreadScratch<K>(), [&](std::uint32_t p) {
      if (Cuts(cells_[p], At(p), q)) cut_by[i].push_back(p);
    });
  });

  std::vector<std::pair<std::uint32_t, std::uint32_t>> cuts;  // star, new point
  for (std::uint32_t i = 0; i < count; ++i)
    for (const std::uint32_t p : cut_by[i]) cuts.emplace_back(p, first + i);
  cut_by.clear();
  std::sort(cuts.begin(), cuts.end());
  std::vector<std::size_t> begins;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    if (i == 0 || cuts[i].first != cuts[i - 1].first) {
      begins.push_back(i);
      change.stars.push_back(cuts[i].first);
    }
  }
  begins.push_back(cuts.size());

  const auto note_neighbours = [&](std::uint32_t p) {
    for (const auto& facet : cells_[p].facets())
      if (!IsFake(facet.id)) around->push_back(facet.id);
  };
  if (around)
    for (const std::uint32_t p : change.stars) note_neighbours(p);

  struct Swap {
    std::vector<Simplex> removed, added;
  };
  std::vector<Swap> swaps(change.stars.size() + count);
  ParallelFor(change.stars.size(), [&](std::size_t i) {
    const std::uint32_t p = change.stars[i];
    std::vector<Simplex> before, after;
    Owned(p, &before);
    for (std::size_t j = begins[i]; j < begins[i + 1]; ++j)
      ClipBy(cells_[p], At(p), At(cuts[j].second), nullptr, ThreadScratch<K>());
    Owned(p, &after);
    std::set_difference(before.begin(), before.end(), after.begin(), after.end(),
                        std::back_inserter(swaps[i].removed));
    std::set_difference(after.begin(), after.end(), before.begin(), before.end(),
                        std::back_inserter(swaps[i].added));
  });
  for (std::uint32_t i = 0; i < count; ++i)
    Owned(first + i, &swaps[change.stars.size() + i].added);

  if (around) {
    for (const std::uint32_t p : change.stars) note_neighbours(p);
    for (std::uint32_t p = first; p < size(); ++p) note_neighbours(p);
  }
  for (const std::uint32_t p : change.stars) tree_.SetInfluence(p, Influence(cells_[p]));
  for (std::uint32_t p = first; p < size(); ++p) tree_.SetInfluence(p, Influence(cells_[p]));
  tree_.Refit();
  for (const Swap& swap : swaps) {
    for (const Simplex& s : swap.removed)
      change.removed.insert(change.removed.end(), s.begin(), s.end());
    for (const Simplex& s : swap.added) change.added.insert(change.added.end(), s.begin(), s.end());
  }
  simplex_count_ += change.added.size() / (K + 1);
  simplex_count_ -= change.removed.size() / (K + 1);
  return change;
}

template <int K>
void StarComplex<K>::TryPoint(const double* point, const double* tangent,
                              typename Cell::Scratch& scratch, Tentative* result) const {
  const Site guest{size(), point, tangent};
  result->cut.clear();
  BuildStar(guest, &guest, result->own, scratch, [&](std::uint32_t p) {
    if (!Cuts(cells_[p], At(p), guest)) return;
    result->cut.emplace_back(p, cells_[p]);
    ClipBy(result->cut.back().second, At(p), guest, &guest, scratch);
  });
  std::sort(result->cut.begin(), result->cut.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
}

template <int K>
std::vector<std::uint32_t> StarComplex<K>::Simplices() const {
  std::vector<std::uint32_t> all;
  all.reserve(simplex_count_ * (K + 1));
  std::vector<Simplex> owned;
  for (std::uint32_t p = 0; p < cells_.size(); ++p) {
    Owned(p, &owned);
    for (const Simplex& s : owned) all.insert(all.end(), s.begin(), s.end());
  }
  return all;
}

template <int K>
Eigen::MatrixXd StarComplex<K>::TangentMatrix() const {
  Eigen::MatrixXd matrix(d_ * K, size());
  for (std::uint32_t p = 0; p < size(); ++p)
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < d_; ++i) matrix(i * K + a, p) = Tangent(p)[a * d_ + i];
  return matrix;
}

template class StarComplex<1>;
template class StarComplex<2>;
template class StarComplex<3>;
template class StarComplex<4>;
template class StarComplex<5>;

}  // namespace stellate::core
