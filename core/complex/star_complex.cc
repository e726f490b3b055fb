#include "core/complex/star_complex.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <iterator>

namespace stellate::core {

template <int K>
StarComplex<K>::StarComplex(int d, double epsilon, double inradius)
    : d_(d), inradius_(inradius), weight_scale_(1e-10 * epsilon * epsilon), tree_(d, &points_) {}

template <int K>
double StarComplex<K>::Project(std::uint32_t p, const double* q, double* normal) const {
  const double* at = Point(p);
  const double* tangent = Tangent(p);
  if (d_ <= 16) {  // the difference once, on the stack
    double e[16];
    for (int i = 0; i < d_; ++i) e[i] = q[i] - at[i];
    for (int a = 0; a < K; ++a) normal[a] = Dot(tangent + a * d_, e, d_);
    return Dot(e, e, d_);
  }
  thread_local std::vector<double> e;
  e.resize(stride());
  for (int i = 0; i < d_; ++i) e[static_cast<std::size_t>(i)] = q[i] - at[i];
  for (int a = 0; a < K; ++a) normal[a] = Dot(tangent + a * d_, e.data(), d_);
  return Dot(e.data(), e.data(), d_);
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
bool StarComplex<K>::ClipBy(Cell& cell, std::uint32_t p, std::uint32_t q,
                            typename Cell::Scratch& scratch) const {
  double normal[K];
  const double distance2 = Project(p, Point(q), normal);
  return cell.Clip(q, normal, 0.5 * (distance2 + Weight(p) - Weight(q)), scratch);
}

template <int K>
void StarComplex<K>::BuildStar(std::uint32_t p, typename Cell::Scratch& scratch) {
  Cell& cell = cells_[p];
  cell.Reset(inradius_);
  tree_.VisitNear(
      Point(p), [&] { return Influence(cell); },
      [&](std::uint32_t q, double) {
        if (q != p) ClipBy(cell, p, q, scratch);
      });
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
  tbb::enumerable_thread_specific<typename Cell::Scratch> scratch;

  // Which old stars does each new point cut? Their influence is still that of before.
  std::vector<std::vector<std::uint32_t>> cut_by(count);
  tbb::parallel_for(std::uint32_t{0}, count, [&](std::uint32_t i) {
    const double* q = Point(first + i);
    const double weight = Weight(first + i);
    tree_.ForEachInfluencing(q, [&](std::uint32_t p) {
      double normal[K];
      const double distance2 = Project(p, q, normal);
      if (cells_[p].WouldCut(normal, 0.5 * (distance2 + Weight(p) - weight)))
        cut_by[i].push_back(p);
    });
    BuildStar(first + i, scratch.local());
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
  tbb::parallel_for(std::size_t{0}, change.stars.size(), [&](std::size_t i) {
    const std::uint32_t p = change.stars[i];
    std::vector<Simplex> before, after;
    Owned(p, &before);
    for (std::size_t j = begins[i]; j < begins[i + 1]; ++j)
      ClipBy(cells_[p], p, cuts[j].second, scratch.local());
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
  const std::uint32_t id = size();
  result->cut.clear();
  tree_.ForEachInfluencing(point, [&](std::uint32_t p) {
    double normal[K];
    const double offset = 0.5 * (Project(p, point, normal) + Weight(p) - Weight(id));
    if (!cells_[p].WouldCut(normal, offset)) return;
    result->cut.emplace_back(p, cells_[p]);
    result->cut.back().second.Clip(id, normal, offset, scratch);
  });
  std::sort(result->cut.begin(), result->cut.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  Cell& own = result->own;
  own.Reset(inradius_);
  thread_local std::vector<double> e;
  e.resize(stride());
  tree_.VisitNear(
      point, [&] { return Influence(own); },
      [&](std::uint32_t q, double) {
        const double* at = Point(q);
        for (int i = 0; i < d_; ++i) e[static_cast<std::size_t>(i)] = at[i] - point[i];
        double normal[K];
        for (int a = 0; a < K; ++a) normal[a] = Dot(tangent + a * d_, e.data(), d_);
        own.Clip(q, normal, 0.5 * (Dot(e.data(), e.data(), d_) + Weight(id) - Weight(q)), scratch);
      });
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
