#include "core/refinement/size_field.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/boundary/boundary_mesh.h"
#include "core/geometry/reach_bound.h"
#include "core/refinement/protecting_balls.h"

namespace stellate::core {
namespace {

// Edges shorter than this share of a star's longest show noise more than curvature.
constexpr double kTellingEdge = 0.5;
// The finest graded sizes, in epsilon. A smaller estimate may be noise; below the limit of given
// sizes the sample's weights would no longer be small compared with circumradii.
constexpr double kFinestEstimated = 1.0 / 64;
constexpr double kFinestGiven = 1.0 / 1024;
// Estimates are spread again whenever the sample has grown by this factor.
constexpr double kSpreadingGrowth = 1.25;

// Returns the largest squared distance of q, along M, from the tangent space of a wall that it
// shares with p. `along`: q - p in p's tangent coordinates.
template <int K>
double OffWalls2(const Stars<K>& stars, std::uint32_t p, std::uint32_t q, const double* along) {
  double most2 = 0;
  const double* conormal = stars.sample().Conormals(p);
  ForEachWall(stars.sample().walls(p), [&](int wall) {
    const double out = Dot(conormal, along, K);
    if (IsSubset(SetOfWall(wall), stars.sample().walls(q))) most2 = std::max(most2, out * out);
    conormal += K;
  });
  return most2;
}

}  // namespace

template <int K>
SizeField<K>::SizeField(const ResolvedCriteria& criteria)
    : epsilon_(criteria.epsilon),
      size_rate_(criteria.size_rate),
      max_deviation_(criteria.max_deviation),
      is_graded_(criteria.graded()),
      is_given_(criteria.sizes_given) {}

// |q - p|^2 / (2 dist(q, T_pM)) bounds the reach from above for any q of M (Federer). Its minimum
// over the edges of a star, without short ones, is the radius of curvature there.
template <int K>
double SizeField<K>::SeenFrom(const Stars<K>& stars, std::uint32_t p) const {
  const auto& cell = stars.cell(p);
  double longest2 = 0;
  for (std::size_t f = 0; f < cell.facet_count(); ++f)
    if (IsSample(cell.id(f))) longest2 = std::max(longest2, stars.EdgeLength2(p, f));
  double size = INFINITY;
  for (std::size_t f = 0; f < cell.facet_count(); ++f) {
    if (!IsSample(cell.id(f))) continue;
    double along[K];
    const double distance2 = 2 * stars.HalfSpace(p, f, along) -
                             stars.sample().ProtectingRadius2(p) +
                             stars.sample().ProtectingRadius2(cell.id(f));
    if (distance2 < kTellingEdge * kTellingEdge * longest2) continue;
    double along2 = 0;
    for (const double a : along) along2 += a * a;
    double away2 = std::max(distance2 - along2, 0.0);
    if (stars.sample().walls(p) != 0) away2 += OffWalls2(stars, p, cell.id(f), along);
    const double away = std::sqrt(away2);
    if (away > 0) size = std::min(size, ReachBound(distance2, away));
  }
  return size;
}

template <int K>
void SizeField<K>::Look(const Stars<K>& stars, const std::vector<std::uint32_t>& ids) {
  seen_.resize(stars.size(), INFINITY);
  ParallelFor(ids.size(), [&](std::size_t i) { seen_[ids[i]] = SeenFrom(stars, ids[i]); });
  is_spread_ = false;
}

// The least of the sizes seen from the star, from its neighbours, and from all stars when they were
// last spread.
template <int K>
double SizeField<K>::Estimate(const Stars<K>& stars, std::uint32_t p) const {
  double size = seen_[p];
  const auto& cell = stars.cell(p);
  for (std::size_t f = 0; f < cell.facet_count(); ++f) {
    const std::uint32_t q = cell.id(f);
    if (!IsSample(q)) continue;
    const double there = q < spread_.size() ? std::min(spread_[q], seen_[q]) : seen_[q];
    size = std::min(size, there + std::sqrt(stars.EdgeLength2(p, f)));
  }
  return size;
}

// Computes the largest 1-Lipschitz function over the edges of the stars that is nowhere above the
// sizes seen.
template <int K>
void SizeField<K>::Spread(const Stars<K>& stars) {
  using Entry = std::pair<double, std::uint32_t>;
  std::vector<Entry> queue;
  for (std::uint32_t p = 0; p < stars.size(); ++p)
    if (seen_[p] < INFINITY) queue.emplace_back(seen_[p], p);
  std::make_heap(queue.begin(), queue.end(), std::greater<>());
  spread_ = seen_;
  for (std::size_t step = 0; !queue.empty(); ++step) {
    CheckInterruption(step);
    std::pop_heap(queue.begin(), queue.end(), std::greater<>());
    const auto [size, p] = queue.back();
    queue.pop_back();
    if (size > spread_[p]) continue;
    const auto& cell = stars.cell(p);
    for (std::size_t f = 0; f < cell.facet_count(); ++f) {
      const std::uint32_t q = cell.id(f);
      if (!IsSample(q)) continue;
      const double there = size + std::sqrt(stars.EdgeLength2(p, f));
      if (!(there < spread_[q])) continue;
      spread_[q] = there;
      queue.emplace_back(there, q);
      std::push_heap(queue.begin(), queue.end(), std::greater<>());
    }
  }
  is_spread_ = true;
  spread_over_ = stars.size();
}

template <int K>
bool SizeField<K>::NeedsSpreading(const Stars<K>& stars, bool nothing_else_to_do) const {
  return is_estimated() &&
         ((nothing_else_to_do && !is_spread_) || stars.size() > kSpreadingGrowth * spread_over_);
}

template <int K>
double SizeField<K>::WantedFor(double size) const {
  const double by_deviation = std::sqrt(2 * max_deviation_ * size);
  return std::min(size_rate_ * size, by_deviation);
}

template <int K>
double SizeField<K>::FinestBound() const {
  return (is_given_ ? kFinestGiven : kFinestEstimated) * epsilon_;
}

template <int K>
double SizeField<K>::BoundFor(double size) const {
  return std::clamp(WantedFor(size), FinestBound(), epsilon_);
}

// Given sizes count only for the star's own vertex: if they differ within a simplex, the star of
// the vertex with the smallest refines it.
template <int K>
double SizeField<K>::BoundAt(const Stars<K>& stars, std::uint32_t p) const {
  if (!is_graded_) return epsilon_;
  if (is_given_) return BoundFor(given_[p]);
  // The bound that a ball was made by stays, whatever is estimated later.
  return std::max(BoundFor(Estimate(stars, p)),
                  std::sqrt(stars.sample().ProtectingRadius2(p)) / kLargestBall);
}

template <int K>
double SizeField<K>::MaxRadiusOverSize(const Stars<K>& stars, bool boundary_only) {
  if (is_given_) {
    std::vector<std::uint32_t> all(stars.size());
    std::iota(all.begin(), all.end(), 0u);
    Look(stars, all);
    Spread(stars);
  }
  double most = 0;
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    CheckInterruption(p);
    const double norm2 = boundary_only ? MaxBoundaryNorm2<K>(stars, p) : stars.cell(p).max_norm2();
    most = std::max(most, std::sqrt(norm2) / Estimate(stars, p));
  }
  return most;
}

template <int K>
std::uint64_t SizeField<K>::CountTooFine() const {
  std::uint64_t count = 0;
  for (const double size : given_) count += WantedFor(size) < FinestBound();
  return count;
}

STELLATE_INSTANTIATE_CLASS(SizeField)

}  // namespace stellate::core
