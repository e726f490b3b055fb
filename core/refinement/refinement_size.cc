// Sizes that follow the local feature size (Criteria::size_rate, max_deviation).

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "core/base/parallel.h"
#include "core/refinement/refinement.h"

namespace stellate::core {
namespace {

// Shorter edges than this share of a star's longest say little of curvature and much of noise.
constexpr double kTellingEdge = 0.5;
// The finest graded sizes, in epsilon: an estimate may come of noise; what is given is meant, but
// below it the weights of StarComplex would no longer be small against circumradii.
constexpr double kFinestEstimated = 1.0 / 64;
constexpr double kFinestGiven = 1.0 / 1024;

}  // namespace

// |q - p|^2 / (2 dist(q, T_pM)) bounds the reach from above for any q of M (Federer); over the
// edges of a star, short ones left out, it is the radius of curvature there.
template <int K>
double Refinement<K>::SizeSeenFrom(std::uint32_t p) const {
  const auto& cell = complex_.cell(p);
  double longest2 = 0;
  for (std::size_t f = 0; f < cell.facet_count(); ++f)
    if (!IsFake(cell.id(f))) longest2 = std::max(longest2, complex_.EdgeLength2(p, f));
  double size = INFINITY;
  for (std::size_t f = 0; f < cell.facet_count(); ++f) {
    if (IsFake(cell.id(f))) continue;
    double along[K];
    const double distance2 = 2 * complex_.HalfSpace(p, f, along);
    if (distance2 < kTellingEdge * kTellingEdge * longest2) continue;
    double along2 = 0;
    for (const double a : along) along2 += a * a;
    const double away = std::sqrt(std::max(distance2 - along2, 0.0));
    if (away > 0) size = std::min(size, distance2 / (2 * away));
  }
  return size;
}

// What is seen from there, from the neighbours, and from all when that was last spread.
template <int K>
double Refinement<K>::LocalSize(std::uint32_t p) const {
  double size = size_seen_[p];
  const auto& cell = complex_.cell(p);
  for (std::size_t f = 0; f < cell.facet_count(); ++f) {
    const std::uint32_t q = cell.id(f);
    if (IsFake(q)) continue;
    const double there =
        q < local_size_.size() ? std::min(local_size_[q], size_seen_[q]) : size_seen_[q];
    size = std::min(size, there + std::sqrt(complex_.EdgeLength2(p, f)));
  }
  return size;
}

// The largest 1-Lipschitz function over the edges of the stars that is nowhere above what is seen.
template <int K>
void Refinement<K>::SpreadSizes() {
  using Entry = std::pair<double, std::uint32_t>;
  std::vector<Entry> queue;
  for (std::uint32_t p = 0; p < complex_.size(); ++p)
    if (size_seen_[p] < INFINITY) queue.emplace_back(size_seen_[p], p);
  std::make_heap(queue.begin(), queue.end(), std::greater<>());
  local_size_ = size_seen_;
  for (std::size_t step = 0; !queue.empty(); ++step) {
    LookUp(step);
    std::pop_heap(queue.begin(), queue.end(), std::greater<>());
    const auto [size, p] = queue.back();
    queue.pop_back();
    if (size > local_size_[p]) continue;
    const auto& cell = complex_.cell(p);
    for (std::size_t f = 0; f < cell.facet_count(); ++f) {
      const std::uint32_t q = cell.id(f);
      if (IsFake(q)) continue;
      const double there = size + std::sqrt(complex_.EdgeLength2(p, f));
      if (!(there < local_size_[q])) continue;
      local_size_[q] = there;
      queue.emplace_back(there, q);
      std::push_heap(queue.begin(), queue.end(), std::greater<>());
    }
  }
}

template <int K>
double Refinement<K>::WantedFor(double size) const {
  const double by_deviation = std::sqrt(2 * criteria_.max_deviation * size);
  return std::min(criteria_.size_rate * size, by_deviation);
}

template <int K>
double Refinement<K>::FinestBound() const {
  return (criteria_.sizes_given ? kFinestGiven : kFinestEstimated) * criteria_.epsilon;
}

template <int K>
double Refinement<K>::BoundFor(double size) const {
  return std::clamp(WantedFor(size), FinestBound(), criteria_.epsilon);
}

// Of given sizes the star's own alone: where they differ within a simplex, the star of the vertex
// that has the smallest sees to it.
template <int K>
double Refinement<K>::SizeBound(std::uint32_t p) const {
  if (!criteria_.graded()) return criteria_.epsilon;
  return BoundFor(criteria_.sizes_given ? given_size_[p] : LocalSize(p));
}

// How coarse the mesh is, the certificate judges by what the sample shows: given sizes need not be
// local feature sizes.
template <int K>
void Refinement<K>::DescribeSizes(StarFacts* facts) {
  if (criteria_.sizes_given) {
    size_seen_.resize(complex_.size());
    ParallelFor(complex_.size(), [&](std::uint32_t p) { size_seen_[p] = SizeSeenFrom(p); });
    SpreadSizes();
    for (const double size : given_size_) too_fine_ += WantedFor(size) < FinestBound();
  }
  for (std::uint32_t p = 0; p < complex_.size(); ++p) {
    LookUp(p);
    const double radius = std::sqrt(complex_.cell(p).max_norm2());
    facts->max_size_ratio = std::max(facts->max_size_ratio, radius / LocalSize(p));
  }
}

// A star's bound also follows its neighbours, whose sizes may have changed after it was judged.
template <int K>
void Refinement<K>::JudgeAllSizes() {
  SpreadSizes();
  std::vector<std::optional<Violation<K>>> violations(complex_.size());
  ParallelFor(complex_.size(), [&](std::uint32_t p) {
    violations[p] = WorstSizeOrShape<K>(complex_, p, SizeBound(p), criteria_.radius_edge_bound);
  });
  active_.clear();
  for (std::uint32_t p = 0; p < complex_.size(); ++p) {
    LookUp(p);
    if (violations[p]) {
      standing_[p] = kSizeOrShape;
      active_.push_back({p, *violations[p]});
    } else if (standing_[p] == kSizeOrShape) {
      standing_[p] = kFine;
    }
  }
  sizes_judged_ = true;
  sizes_judged_at_ = complex_.size();
}

#define STELLATE_INSTANTIATE(K)                                     \
  template double Refinement<K>::SizeSeenFrom(std::uint32_t) const; \
  template double Refinement<K>::LocalSize(std::uint32_t) const;    \
  template void Refinement<K>::SpreadSizes();                       \
  template double Refinement<K>::WantedFor(double) const;           \
  template double Refinement<K>::FinestBound() const;               \
  template double Refinement<K>::BoundFor(double) const;            \
  template double Refinement<K>::SizeBound(std::uint32_t) const;    \
  template void Refinement<K>::DescribeSizes(StarFacts*);           \
  template void Refinement<K>::JudgeAllSizes();
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
