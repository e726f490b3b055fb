// Answers that were not inserted are known points of M all the same: where the finished mesh has
// nothing near one, refinement goes on from there.

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/certificate/evidence.h"
#include "core/refinement/refinement.h"

namespace stellate::core {
namespace {

// Each finds a part of M that was missed, and most manifolds have one part.
constexpr int kMostEvidenceRounds = 16;

}  // namespace

template <int K>
void Refinement<K>::KeepAsEvidence() {
  if (rehearsal_) return;
  for (Eigen::Index c = 0; c < points_.cols(); ++c) {
    if (!answered_[static_cast<std::size_t>(c)] || used_[static_cast<std::size_t>(c)]) continue;
    evidence_.insert(evidence_.end(), points_.col(c).begin(), points_.col(c).end());
  }
}

// How far y is from the sample, in circumradii of the star there.
template <int K>
double Refinement<K>::ClearanceOf(const double* y, std::uint32_t* nearest) const {
  std::pair<double, std::uint32_t> found;
  if (complex_.Nearest(y, 1, &found) == 0) return INFINITY;
  *nearest = found.second;
  return std::sqrt(found.first / complex_.cell(found.second).max_norm2());
}

template <int K>
std::vector<double> Refinement<K>::UncoveredEvidence() const {
  const std::size_t d = static_cast<std::size_t>(complex_.d());
  return ParallelGather<double>(evidence_.size() / d, [&](std::size_t i, auto* uncovered) {
    const double* y = evidence_.data() + i * d;
    std::uint32_t nearest = 0;
    if (ClearanceOf(y, &nearest) > kCoverageShare) uncovered->insert(uncovered->end(), y, y + d);
  });
}

// Asks for `points` of M, d each, with all that inserting them needs. False if there are none, or
// if it did not help before.
template <int K>
bool Refinement<K>::AskForEvidence(const std::vector<double>& points) {
  if (points.empty() || evidence_rounds_ == kMostEvidenceRounds) return false;
  ++evidence_rounds_;
  const auto d = static_cast<std::size_t>(complex_.d());
  // One of those that lie together.
  std::vector<const double*> chosen;
  for (std::size_t at = 0; at < points.size(); at += d) {
    LookUp(at);
    const double* y = points.data() + at;
    std::pair<double, std::uint32_t> nearest;
    complex_.Nearest(y, 1, &nearest);
    const double apart = std::min(criteria_.epsilon, std::sqrt(nearest.first) / 2);
    if (std::none_of(chosen.begin(), chosen.end(),
                     [&](const double* other) { return Distance(y, other, complex_.d()) < apart; }))
      chosen.push_back(y);
  }
  QueryBlock block = NewBlock(QueryKind::kClosestPoint);
  block.points.resize(complex_.d(), static_cast<Eigen::Index>(chosen.size()));
  for (std::size_t i = 0; i < chosen.size(); ++i)
    std::copy_n(chosen[i], d, block.points.col(static_cast<Eigen::Index>(i)).data());
  if (certifier_) evidence_ = certifier_->TakeSeen();
  certifier_.reset();
  certified_simplices_ = {};
  purpose_ = Purpose::kEvidence;
  AskAgain(block, Stage::kPoints);
  return true;
}

template <int K>
void Refinement<K>::InsertEvidence() {
  for (Eigen::Index c = 0; c < points_.cols(); ++c) {
    if (!found_[static_cast<std::size_t>(c)]) continue;
    if (complex_.size() >= spec_.limits.max_vertices) break;
    Append(c, StarComplex<K>::kNone);
  }
  // What grows from here is judged anew once it is whole.
  all_suspect_ = true;
  blemished_.clear();
  filled_stars_.clear();
}

#define STELLATE_INSTANTIATE(K)                                                    \
  template void Refinement<K>::KeepAsEvidence();                                   \
  template double Refinement<K>::ClearanceOf(const double*, std::uint32_t*) const; \
  template std::vector<double> Refinement<K>::UncoveredEvidence() const;           \
  template bool Refinement<K>::AskForEvidence(const std::vector<double>&);         \
  template void Refinement<K>::InsertEvidence();
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
