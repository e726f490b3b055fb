// What becomes of answered points: the insertions of Refinement.

#include <algorithm>
#include <limits>
#include <sstream>

#include "core/base/parallel.h"
#include "core/refinement/refinement.h"

namespace stellate::core {
namespace {

// Answered seeds that are asked for once more.
constexpr Eigen::Index kIdempotenceSample = 64;

// Where R is large the image of a circumcentre may fall anywhere: one that comes nearer than this
// share of epsilon, or of a shorter step, to the sample would cost quality, so the step is
// shortened instead.
constexpr double kCoarseSpacing = 0.5;
// Otherwise the ball around the circumcentre is empty but for curvature. A point of it that has the
// sample nearer than this share of the circumradius says that epsilon is too coarse for that; to
// insert it could make edges shorter than the one that R2 complained of (rho0 = 2), without end.
constexpr double kEmptyBall = 0.5;
// Targets of a round lie R apart: images no farther than this share of R from their targets lie at
// least R / 2 apart, as far as the empty ball asks.
constexpr double kCalm = 0.25;
// What is rehearsed can wait until it is known better.
constexpr double kRehearsedSpacing = 0.9;
// Good points are chosen off the centre.
constexpr double kGoodPointSpacing = 0.25;

}  // namespace

template <int K>
void Refinement<K>::InsertSeeds() {
  Eigen::Index found = 0;
  for (const std::uint8_t f : found_) found += f;
  covers_box_ = spec_.cover_box && found == points_.cols();
  if (found == 0) {
    std::ostringstream out;
    out << "no seed has a closest point on the manifold: " << points_.cols()
        << (spec_.seeds.cols() > 0 ? " seeds were" : " points of the bounding box were")
        << " tried; give seeds near the manifold, or a box that holds it";
    if (!spec_.oracle.tangent_basis)
      out << "; seeds where the manifold does not look " << K << "-dimensional count as not found";
    return Fail({StatusCode::kNoSeeds, out.str()});
  }
  idempotence_sample_.resize(complex_.d(), std::min(found, kIdempotenceSample));
  idempotence_sizes_.resize(idempotence_sample_.cols());
  Eigen::Index sampled = 0;
  for (Eigen::Index c = 0; c < points_.cols(); ++c) {
    if (!found_[static_cast<std::size_t>(c)]) continue;
    if (sampled < idempotence_sample_.cols()) {
      idempotence_sample_.col(sampled) = points_.col(c);
      if (criteria_.sizes_given) idempotence_sizes_[sampled] = sizes_[c];
      ++sampled;
    }
    if (complex_.size() < spec_.limits.max_vertices &&
        !complex_.AnyWithin(points_.col(c).data(), criteria_.epsilon))
      Append(c, StarComplex<K>::kNone);
    else
      ++report_.counts.duplicates;
  }
}

// R1 and R2 insert the image of the circumcentre if that mends anything; R3 and R4 the best of
// their candidates, each judged against the complex as it was before the round.
template <int K>
void Refinement<K>::InsertTargets() {
  std::vector<int> best(targets_.size(), 0);
  std::vector<Fitness> fitness(targets_.size());
  ParallelFor(targets_.size(), [&](std::size_t i) {
    if (targets_[i].violation.rule >= Rule::kSliver)
      best[i] = BestCandidate(i);
    else
      fitness[i] = JudgeRefined(i);
  });
  bool all_calm = true;
  for (std::size_t i = 0; i < targets_.size(); ++i) {
    LookUp(i);
    if (targets_[i].violation.rule >= Rule::kSliver)
      InsertGoodPoint(i, best[i]);
    else
      InsertRefined(i, fitness[i], &all_calm);
  }
}

template <int K>
double Refinement<K>::Clearance(const Target<K>& t) const {
  const double coarse = rehearsal_ ? kRehearsedSpacing : kCoarseSpacing;
  const double empty = rehearsal_ ? kRehearsedSpacing : kEmptyBall;
  return IsCoarse(t.star, t.violation) ? coarse * std::min(SizeBound(t.star), t.radius)
                                       : empty * t.radius;
}

template <int K>
typename Refinement<K>::Fitness Refinement<K>::JudgeRefined(std::size_t i) const {
  const Target<K>& t = targets_[i];
  const Eigen::Index c = first_candidate_[i];
  Fitness fitness;
  fitness.found = found_[static_cast<std::size_t>(c)];
  if (!fitness.found) return fitness;
  const double* y = points_.col(c).data();
  fitness.duplicate = complex_.AnyWithin(y, Clearance(t));
  fitness.mends = !fitness.duplicate && complex_.CutsVertex(t.star, t.violation.vertex, y);
  fitness.calm =
      !rehearsal_ && Distance(y, candidates_.col(c).data(), complex_.d()) <= kCalm * t.radius;
  return fitness;
}

template <int K>
void Refinement<K>::InsertRefined(std::size_t i, Fitness fitness, bool* all_calm) {
  const Target<K>& t = targets_[i];
  const Eigen::Index c = first_candidate_[i];
  if (!fitness.found) {
    if (FindsFlats(t) && !rehearsal_)
      no_flat_[t.star] = 1;
    else
      Discourage(t.star);
    return;
  }
  const double* y = points_.col(c).data();
  // Another of this round may have come near, unless all have stayed near where they were aimed.
  *all_calm = *all_calm && fitness.calm;
  if (fitness.mends && !*all_calm) fitness.duplicate = complex_.AnyWithin(y, Clearance(t));
  if (fitness.duplicate || !fitness.mends) {
    report_.counts.duplicates += fitness.duplicate;
    return Discourage(t.star);
  }
  front_moved_ = front_moved_ || t.violation.fake;
  Insert(c, t.violation.rule, t.star);
}

template <int K>
void Refinement<K>::Append(Eigen::Index c, std::uint32_t near) {
  complex_.Append(points_.col(c).data(), tangents_.col(c).data(), near);
  if (criteria_.sizes_given) given_size_.push_back(sizes_[c]);
  used_[static_cast<std::size_t>(c)] = 1;
}

template <int K>
void Refinement<K>::Insert(Eigen::Index c, Rule rule, std::uint32_t near) {
  Append(c, near);
  if (rehearsal_) inserted_rules_.push_back(rule);
  Counts& counts = report_.counts;
  switch (rule) {
    case Rule::kSize:
      ++counts.inserted_size;
      break;
    case Rule::kRadiusEdge:
      ++counts.inserted_radius_edge;
      break;
    case Rule::kSliver:
      ++counts.inserted_sliver;
      break;
    case Rule::kInconsistent:
      ++counts.inserted_inconsistent;
      break;
  }
}

template <int K>
int Refinement<K>::BestCandidate(std::size_t i) const {
  const Target<K>& t = targets_[i];
  thread_local typename StarComplex<K>::Cell::Scratch scratch;
  thread_local typename StarComplex<K>::Tentative tentative;
  int best = -1, fewest = std::numeric_limits<int>::max();
  for (Eigen::Index c = first_candidate_[i]; c < first_candidate_[i + 1] && fewest > 0; ++c) {
    if (!found_[static_cast<std::size_t>(c)]) continue;
    const double* y = points_.col(c).data();
    if (!complex_.CutsVertex(t.star, t.violation.vertex, y) ||
        complex_.AnyWithin(y, kGoodPointSpacing * t.radius))
      continue;
    const int index = static_cast<int>(c - first_candidate_[i]);
    if (criteria_.candidates == 1) return index;
    complex_.TryPoint(y, tangents_.col(c).data(), t.star, scratch, &tentative);
    const int bad = CountBad<K>(complex_, y, tentative, criteria_.shape,
                                criteria_.small_sliver_radius * t.radius, fewest);
    if (bad < fewest) {
      fewest = bad;
      best = index;
    }
  }
  return best;
}

template <int K>
void Refinement<K>::InsertGoodPoint(std::size_t i, int best) {
  const Target<K>& t = targets_[i];
  if (best < 0) {
    no_flat_[t.star] = 1;  // if that was why
    return Discourage(t.star);
  }
  const Eigen::Index c = first_candidate_[i] + best;
  const double* y = points_.col(c).data();
  if (complex_.AnyWithin(y, kGoodPointSpacing * t.radius))
    return;  // another of this round came near
  Insert(c, t.violation.rule, t.star);
}

#define STELLATE_INSTANTIATE(K)                                                            \
  template void Refinement<K>::InsertSeeds();                                              \
  template void Refinement<K>::InsertTargets();                                            \
  template double Refinement<K>::Clearance(const Target<K>&) const;                        \
  template typename Refinement<K>::Fitness Refinement<K>::JudgeRefined(std::size_t) const; \
  template void Refinement<K>::InsertRefined(std::size_t, Fitness, bool*);                 \
  template void Refinement<K>::Append(Eigen::Index, std::uint32_t);                        \
  template void Refinement<K>::Insert(Eigen::Index, Rule, std::uint32_t);                  \
  template int Refinement<K>::BestCandidate(std::size_t) const;                            \
  template void Refinement<K>::InsertGoodPoint(std::size_t, int);
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
