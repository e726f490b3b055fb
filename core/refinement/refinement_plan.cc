// How a round is planned: the questions of Refinement.

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "core/base/basis_layout.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/complex/consistency.h"
#include "core/refinement/refinement.h"

namespace stellate::core {
namespace {

// A star whose refinement failed this often in a row is left alone.
constexpr int kGiveUp = 8;
// Good points that no longer help: this many times the vertices that R1 and R2 needed.
constexpr double kMostGrowth = 4;
constexpr std::uint64_t kLeastGrowth = 2000;

// A rehearsal that begins from many seeds needs no front: this share of the vertices to come, as
// far as the box tells, within limits.
constexpr double kSeedShare = 0.05;
constexpr double kLeastAheadSeeds[kMaxDimension + 1] = {0, 100, 300, 300, 1000, 1000};
constexpr double kMostAheadSeeds[kMaxDimension + 1] = {0, 100, 1000, 1000, 3000, 3000};

// Graded sizes are spread over all stars anew whenever the sample has grown so much.
constexpr double kSizesGrowth = 1.25;

// Where cavities are filled: below, good points mend the few stars that disagree.
constexpr int kFirstFilled = 4;

// A point of the unit ball of R^K, uniform.
template <int K>
void UniformInBall(Random& random, double* x) {
  double norm2 = 0;
  for (int a = 0; a < K; ++a) {
    x[a] = random.Normal();
    norm2 += x[a] * x[a];
  }
  const double scale = std::pow(random.Uniform(), 1.0 / K) / std::sqrt(norm2);
  for (int a = 0; a < K; ++a) x[a] *= scale;
}

// The order in which to go through `ids` so that neighbours follow each other: what one star's
// judge has read of theirs is in the cache for the next.
template <int K>
std::vector<std::uint32_t> InOrderOfPlace(const StarComplex<K>& complex,
                                          const std::vector<std::uint32_t>& ids) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> places(ids.size());
  ParallelFor(ids.size(), [&](std::size_t i) {
    places[i] = {complex.PlaceOf(ids[i]), static_cast<std::uint32_t>(i)};
  });
  ParallelSort(places, std::less<>());
  std::vector<std::uint32_t> order;
  order.reserve(places.size());
  for (const auto& [place, i] : places) {
    LookUp(order.size());
    order.push_back(i);
  }
  return order;
}

int SeedsToAskAheadFrom(const Specification& spec) {
  const double width = (spec.bounding_box->upper - spec.bounding_box->lower).norm();
  const double vertices = std::pow(width / spec.epsilon, spec.dimension);
  return static_cast<int>(std::clamp(kSeedShare * vertices, kLeastAheadSeeds[spec.dimension],
                                     kMostAheadSeeds[spec.dimension]));
}

}  // namespace

template <int K>
void Refinement<K>::AskForSeeds() {
  QueryBlock block = NewBlock(QueryKind::kClosestPoint);
  if (spec_.seeds.cols() > 0) {
    block.points = spec_.seeds;
  } else if (spec_.cover_box) {
    block.points = CoverOfBox(spec_);
  } else {
    const BoundingBox& box = *spec_.bounding_box;
    const int count = spec_.box_seeds > 0   ? spec_.box_seeds
                      : criteria_.ask_ahead ? SeedsToAskAheadFrom(spec_)
                                            : kDefaultBoxSeeds;
    block.points.resize(spec_.ambient_dimension, count);
    Random random(spec_.random_seed);
    for (Eigen::Index i = 0; i < count; ++i)
      for (Eigen::Index j = 0; j < block.points.rows(); ++j)
        block.points(j, i) = box.lower[j] + random.Uniform() * (box.upper[j] - box.lower[j]);
  }
  purpose_ = Purpose::kSeeds;
  AskAgain(block, Stage::kPoints);
}

template <int K>
QueryBlock Refinement<K>::NewBlock(QueryKind kind) const {
  QueryBlock block;
  block.kind = kind;
  block.want_tangents = spec_.oracle.tangent_basis;
  block.want_sizes = criteria_.sizes_given;
  return block;
}

template <int K>
void Refinement<K>::AskAgain(const QueryBlock& block, Stage stage) {
  batch_.emplace();
  batch_->blocks.push_back(block);
  stage_ = stage;
}

template <int K>
bool Refinement<K>::FindsFlats(const Target<K>& target) const {
  return spec_.oracle.intersect_flat && !target.violation.fake && !no_flat_[target.star];
}

// Where to insert for a violation: at the circumcentre, but no farther out than the advance step,
// and, where all is coarse, nearer after each failed attempt.
template <int K>
Target<K> Refinement<K>::Aim(std::uint32_t star, const Violation<K>& violation) const {
  Target<K> target;
  target.star = star;
  target.violation = violation;
  // Many steps are as long as they may be: exactly so, lest rounding say which comes first.
  target.radius = violation.radius;
  if (violation.rule < Rule::kSliver) {
    target.radius = std::min(target.radius, criteria_.advance_step);
    if (IsCoarse(star, violation)) target.radius = std::ldexp(target.radius, -discouraged_[star]);
  }
  const double scale = target.radius / violation.radius;
  for (int a = 0; a < K; ++a) target.x[a] = violation.x[a] * scale;
  return target;
}

// A simplex is mostly the worst one of several of its vertices' stars: the lowest of them has the
// target, unless an attempt from there has failed.
template <int K>
std::vector<Target<K>> Refinement<K>::SizeAndShapeTargets() {
  constexpr std::uint16_t kNone = 0xffff;
  std::vector<std::uint16_t> worst(complex_.size(), kNone);
  for (std::size_t i = 0; i < active_.size(); ++i) {
    LookUp(i);
    worst[active_[i].star] = static_cast<std::uint16_t>(active_[i].violation.vertex);
  }
  const auto is_seen_from_lower = [&](const Active& a) {
    typename StarComplex<K>::Simplex simplex, other;
    if (!complex_.SimplexOf(a.star, complex_.cell(a.star), a.violation.vertex, &simplex))
      return false;
    for (const std::uint32_t q : simplex) {
      if (q == a.star) return false;
      if (worst[q] != kNone && discouraged_[q] == 0 &&
          complex_.SimplexOf(q, complex_.cell(q), worst[q], &other) && other == simplex)
        return true;
    }
    return false;
  };
  std::vector<std::uint8_t> is_target(active_.size());
  ParallelFor(active_.size(), [&](std::size_t i) {
    is_target[i] = discouraged_[active_[i].star] <= kGiveUp && !is_seen_from_lower(active_[i]);
  });
  std::vector<Target<K>> targets;
  targets.reserve(static_cast<std::size_t>(std::count(is_target.begin(), is_target.end(), 1)));
  for (std::size_t i = 0; i < active_.size(); ++i) {
    LookUp(i);
    if (is_target[i]) targets.push_back(Aim(active_[i].star, active_[i].violation));
  }
  return targets;
}

template <int K>
std::vector<Target<K>> Refinement<K>::SliverAndConsistencyTargets() {
  if (all_suspect_) {
    suspects_.resize(complex_.size());
    std::iota(suspects_.begin(), suspects_.end(), 0u);
    all_suspect_ = false;
    before_good_points_ = complex_.size();
  }
  suspects_.insert(suspects_.end(), blemished_.begin(), blemished_.end());
  suspects_.insert(suspects_.end(), filled_stars_.begin(), filled_stars_.end());
  ParallelSort(suspects_, std::less<>());
  suspects_.erase(std::unique(suspects_.begin(), suspects_.end()), suspects_.end());
  std::vector<std::optional<Violation<K>>> found(suspects_.size());
  const std::vector<std::uint32_t> near = InOrderOfPlace<K>(complex_, suspects_);
  ParallelFor(suspects_.size(), [&](std::size_t i) {
    found[near[i]] = WorstSliverOrInconsistent<K>(complex_, suspects_[near[i]], criteria_.shape);
  });
  FillCavitiesIfAny(found);
  std::vector<Target<K>> targets;
  blemished_.clear();
  filled_stars_.clear();
  progress_.bad_sliver = progress_.bad_inconsistent = 0;
  for (std::size_t i = 0; i < suspects_.size(); ++i) {
    LookUp(i);
    const std::uint32_t p = suspects_[i];
    standing_[p] = found[i] ? kSliverOrInconsistent : kFine;
    if (!found[i]) continue;
    if (IsFilled(p, *found[i])) {
      filled_stars_.push_back(p);
      continue;
    }
    if (found[i]->lean && discouraged_[p] > kGiveUp) {
      standing_[p] = kFine;  // it will not yield: the certificate says so
      continue;
    }
    blemished_.push_back(p);
    ++(found[i]->rule == Rule::kSliver ? progress_.bad_sliver : progress_.bad_inconsistent);
    if (discouraged_[p] <= kGiveUp) targets.push_back(Aim(p, *found[i]));
  }
  suspects_.clear();
  return targets;
}

template <int K>
void Refinement<K>::FillCavitiesIfAny(const std::vector<std::optional<Violation<K>>>& found) {
  filled_ = {};
  if (K < kFirstFilled || criteria_.judging != Judging::kCommonCentre) return;
  if (std::none_of(found.begin(), found.end(), [](const auto& v) { return v.has_value(); })) return;
  filled_ = FillCavities<K>(
      complex_, {criteria_.epsilon, criteria_.radius_edge_bound, criteria_.shape.sliver_bound});
}

// Whether the violating simplex is not in the mesh anyway, its cavity being filled without it.
template <int K>
bool Refinement<K>::IsFilled(std::uint32_t star, const Violation<K>& violation) const {
  if (filled_.cavities == 0 || violation.fake ||
      std::binary_search(filled_.unfilled.begin(), filled_.unfilled.end(), star))
    return false;
  return violation.rule == Rule::kInconsistent ||
         !IsConsistent<K>(complex_, star, violation.vertex);
}

// Finds what to do next and asks for it, or ends the refinement.
template <int K>
void Refinement<K>::Plan() {
  if (complex_.size() >= spec_.limits.max_vertices) return Finish(Termination::kVertexBudget);
  if (HasLeftBox()) return Finish(Termination::kNoProgress);
  if (!all_suspect_) {
    const double most = std::max(kMostGrowth * static_cast<double>(before_good_points_),
                                 static_cast<double>(before_good_points_ + kLeastGrowth));
    if (static_cast<double>(complex_.size()) > most) {
      if (!std::isfinite(criteria_.shape.reach)) return Finish(Termination::kNoProgress);
      criteria_.shape.reach = INFINITY;  // unproved, but a mesh
    }
  }
  std::vector<Target<K>> targets = SizeAndShapeTargets();
  if (criteria_.estimates_sizes() &&
      ((targets.empty() && !sizes_judged_) || complex_.size() > kSizesGrowth * sizes_judged_at_)) {
    JudgeAllSizes();
    targets = SizeAndShapeTargets();
  }
  if (targets.empty()) targets = SliverAndConsistencyTargets();
  if (targets.empty()) {
    const bool all_filled = std::all_of(active_.begin(), active_.end(), [&](const Active& a) {
      return IsFilled(a.star, a.violation);
    });
    if (!all_filled || !blemished_.empty()) return Finish(Termination::kNoProgress);
    return StartCertificate();
  }
  if (HasStalled()) return Finish(Termination::kNoProgress);
  targets_ = SelectIndependent<K>(complex_, std::move(targets),
                                  spec_.limits.max_vertices - complex_.size());
  if (criteria_.ask_ahead && !ahead_failed_) AskAhead();
  AskForTargets();
}

template <int K>
void Refinement<K>::AskForTargets() {
  first_candidate_.assign(1, 0);
  for (const Target<K>& t : targets_)
    first_candidate_.push_back(first_candidate_.back() + CandidateCount(t));
  const Eigen::Index count = first_candidate_.back();
  const int d = complex_.d();
  candidates_.resize(d, count);
  places_.resize(static_cast<std::size_t>(count));
  QueryBlock flats = NewBlock(QueryKind::kIntersectFlat);
  QueryBlock closest = NewBlock(QueryKind::kClosestPoint);
  Eigen::Index flat_count = 0;
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    LookUp(i);
    if (FindsFlats(targets_[i])) flat_count += first_candidate_[i + 1] - first_candidate_[i];
  }
  flats.points.resize(d, flat_count);
  flats.bases.resize(d * K, flat_count);
  flats.radii.resize(flat_count);
  closest.points.resize(d, count - flat_count);
  if (rehearsal_) closest.radii.resize(count - flat_count);  // what the surrogate is asked for
  const int closest_block = flat_count > 0 ? 1 : 0;
  Eigen::Index next_flat = 0, next_closest = 0;
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    LookUp(i);
    const bool flat = FindsFlats(targets_[i]);
    for (Eigen::Index c = first_candidate_[i]; c < first_candidate_[i + 1]; ++c)
      places_[static_cast<std::size_t>(c)] =
          flat ? std::pair{0, next_flat++} : std::pair{closest_block, next_closest++};
  }
  ParallelFor(targets_.size(), [&](std::size_t i) {
    const Target<K>& t = targets_[i];
    const bool flat = FindsFlats(t);
    Random random(spec_.random_seed ^ Mix64(t.star), whole_rounds_);
    for (Eigen::Index c = first_candidate_[i]; c < first_candidate_[i + 1]; ++c) {
      double x[K];
      std::copy(t.x, t.x + K, x);
      // The first candidate is the circumcentre itself, unless that already failed.
      if (c > first_candidate_[i] || (discouraged_[t.star] && !IsCoarse(t.star, t.violation))) {
        double step[K];
        UniformInBall<K>(random, step);
        for (int a = 0; a < K; ++a) x[a] += criteria_.picking_radius * t.radius * step[a];
      }
      complex_.Lift(t.star, x, candidates_.col(c).data());
      const Eigen::Index column = places_[static_cast<std::size_t>(c)].second;
      if (!flat) {
        if (rehearsal_) closest.radii[column] = t.radius;
        closest.points.col(column) = candidates_.col(c);
        continue;
      }
      flats.points.col(column) = candidates_.col(c);
      ToByCoordinate(complex_.Tangent(t.star), d, K, flats.bases.col(column).data());
      flats.radii[column] = t.radius;
    }
  });
  batch_.emplace();
  if (flat_count > 0) batch_->blocks.push_back(std::move(flats));
  if (count > flat_count) batch_->blocks.push_back(std::move(closest));
  if (ahead_.size() > 0) {
    const int block = static_cast<int>(batch_->blocks.size());
    QueryBlock ahead = NewBlock(QueryKind::kClosestPoint);
    ahead.points = ahead_.points;
    batch_->blocks.push_back(std::move(ahead));
    for (Eigen::Index i = 0; i < ahead_.size(); ++i) places_.emplace_back(block, i);
  }
  stage_ = Stage::kPoints;
  purpose_ = Purpose::kTargets;
  const bool alternates = !spec_.oracle.intersect_flat && ahead_.size() == 0;
  alternations_left_ = alternates ? criteria_.flat_alternations - 1 : 0;
}

// In a rehearsal at once: what the surrogate refuses is left for true points, since shorter steps
// would only crowd the border of what it knows.
template <int K>
void Refinement<K>::Discourage(std::uint32_t star) {
  if (rehearsal_)
    discouraged_[star] = kGiveUp + 1;
  else if (discouraged_[star] <= kGiveUp)
    ++discouraged_[star];
}

#define STELLATE_INSTANTIATE(K)                                                                    \
  template void Refinement<K>::AskForSeeds();                                                      \
  template void Refinement<K>::AskAgain(const QueryBlock&, Stage);                                 \
  template QueryBlock Refinement<K>::NewBlock(QueryKind) const;                                    \
  template bool Refinement<K>::FindsFlats(const Target<K>&) const;                                 \
  template Target<K> Refinement<K>::Aim(std::uint32_t, const Violation<K>&) const;                 \
  template std::vector<Target<K>> Refinement<K>::SizeAndShapeTargets();                            \
  template std::vector<Target<K>> Refinement<K>::SliverAndConsistencyTargets();                    \
  template void Refinement<K>::FillCavitiesIfAny(const std::vector<std::optional<Violation<K>>>&); \
  template bool Refinement<K>::IsFilled(std::uint32_t, const Violation<K>&) const;                 \
  template void Refinement<K>::Plan();                                                             \
  template void Refinement<K>::AskForTargets();                                                    \
  template void Refinement<K>::Discourage(std::uint32_t);
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
