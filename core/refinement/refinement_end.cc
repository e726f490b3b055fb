// How a run ends: the certificate, the report, and the progress towards them.

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>

#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/certificate/evidence.h"
#include "core/certificate/findings.h"
#include "core/complex/consistency.h"
#include "core/refinement/refinement.h"

namespace stellate::core {
namespace {

// Of epsilon: answers wrong by more do not go unnoticed (CheckIdempotence), and points of a run
// that does not end may lie so near to each other that this tells what they seem to bend by.
constexpr double kLikelyError = 1e-3;

}  // namespace

// From here on the mesh is the filled one; the round's delta says what that changes.
template <int K>
void Refinement<K>::HandOutFilled() {
  using Simplex = typename StarComplex<K>::Simplex;
  const auto sorted = [](const std::vector<std::uint32_t>& ids) {
    std::vector<Simplex> simplices(ids.size() / (K + 1));
    ParallelFor(simplices.size(), [&](std::size_t i) {
      std::copy_n(ids.data() + i * (K + 1), K + 1, simplices[i].begin());
    });
    ParallelSort(simplices, std::less<>());
    return simplices;
  };
  // A - B + C, where C is disjoint from what is left of A.
  const auto change = [](const std::vector<Simplex>& a, const std::vector<Simplex>& b,
                         const std::vector<Simplex>& c, std::vector<std::uint32_t>* ids) {
    std::vector<Simplex> all;
    std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
    all.insert(all.end(), c.begin(), c.end());
    ParallelSort(all, std::less<>());
    ids->clear();
    ids->reserve(all.size() * (K + 1));
    for (const Simplex& s : all) ids->insert(ids->end(), s.begin(), s.end());
  };
  const std::vector<Simplex> before = sorted(complex_.Simplices()),
                             after = sorted(filled_.simplices);
  std::vector<Simplex> lost, won, lost_now, won_now;
  std::set_difference(before.begin(), before.end(), after.begin(), after.end(),
                      std::back_inserter(lost));
  std::set_difference(after.begin(), after.end(), before.begin(), before.end(),
                      std::back_inserter(won));
  const std::vector<Simplex> added = sorted(delta_.added), removed = sorted(delta_.removed);
  std::set_difference(won.begin(), won.end(), removed.begin(), removed.end(),
                      std::back_inserter(won_now));
  std::set_difference(lost.begin(), lost.end(), added.begin(), added.end(),
                      std::back_inserter(lost_now));
  change(added, lost, won_now, &delta_.added);
  change(removed, won, lost_now, &delta_.removed);
  filled_over_ = true;
}

// max R_p over the simplices that all stars agree on, squared: the others are not in the mesh.
template <int K>
double Refinement<K>::MaxAgreedNorm2(std::uint32_t p) const {
  const auto& cell = complex_.cell(p);
  double most = 0;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (cell.norm2(v) > most && IsConsistent<K>(complex_, p, v)) most = cell.norm2(v);
  return most;
}

template <int K>
void Refinement<K>::StartCertificate() {
  if (rehearsal_) return Finish(Termination::kConverged);
  if (AskForEvidence(UncoveredEvidence())) return;
  if (!filled_stars_.empty()) HandOutFilled();
  StarFacts facts;
  facts.converged = true;
  facts.covers_box = covers_box_;
  if (!spec_.oracle.tangent_basis) facts.tangent_error_length = tangent_finder_.error_length();
  for (std::uint32_t p = 0; p < complex_.size(); ++p) {
    LookUp(p);
    const double radius =
        std::sqrt(filled_over_ ? MaxAgreedNorm2(p) : complex_.cell(p).max_norm2());
    facts.max_circumradius = std::max(facts.max_circumradius, radius);
  }
  if (criteria_.graded()) DescribeSizes(&facts);
  certified_simplices_ = Simplices();
  const MeshView view{K,
                      complex_.d(),
                      complex_.size(),
                      complex_.points().data(),
                      complex_.Tangent(0),
                      &certified_simplices_};
  certifier_ = std::make_unique<Certifier>(spec_, view, facts, std::move(evidence_));
  if (const auto* blocks = certifier_->NextBlocks()) {
    batch_ = QueryBatch{0, *blocks};
    stage_ = Stage::kCertify;
  } else {
    Finish(Termination::kConverged);
  }
}

template <int K>
void Refinement<K>::Fail(Status reason) {
  if (!over_) report_.failure = std::move(reason);
  Finish(Termination::kOracleFailed);
}

template <int K>
void Refinement<K>::Finish(Termination termination) {
  if (over_) return;
  over_ = true;
  batch_.reset();
  parts_.reset();
  if (rehearsal_) return;
  report_.termination = termination;
  // What a round that was interrupted has left behind was never handed out.
  const bool whole = !interruption_.raised();
  report_.counts.vertices = whole ? complex_.size() : progress_.vertices;
  report_.counts.simplices = whole ? SimplexCount() : progress_.simplices;
  Certificate& certificate = report_.certificate;
  if (termination == Termination::kConverged) {
    certificate = certifier_->certificate();
    if (too_fine_ > 0)
      certificate.warnings.push_back(Message("the sizes given ask for circumradii below ",
                                             Brief(FinestBound()), " at ", too_fine_,
                                             " vertices, finer than is meshed at epsilon ",
                                             Brief(spec_.epsilon), ": take epsilon smaller."));
    if (filled_over_)
      certificate.warnings.push_back(
          Message("Stars disagreed about ", filled_.inconsistent, " simplices in ",
                  filled_.cavities, " places; ", filled_.filling,
                  " simplices fill these instead, not all of them Delaunay."));
  } else {
    certificate.verdict = std::string("not certified: the run ended as ") +
                          TerminationName(termination) + " before every rule held";
    if (!report_.failure.message.empty()) certificate.verdict += ": " + report_.failure.message;
    // Whoever cancels a large mesh does not want to wait for it to be described.
    if (termination != Termination::kCancelled && termination != Termination::kOracleFailed)
      DescribeUnfinished();
    if (termination == Termination::kNoProgress) certificate.verdict += "; " + WhyStopped();
  }
  if (whole) WarnOfBox(&certificate);
  certifier_.reset();
  certified_simplices_ = {};
  if (whole)
    UpdateProgress();
  else
    progress_.phase = Phase::kDone;
}

// What can be said without further questions of a mesh that did not converge. The reach comes from
// neighbours alone: |q - p|^2 / (2 dist(q, T_pM)).
template <int K>
void Refinement<K>::DescribeUnfinished() {
  Certificate& certificate = report_.certificate;
  double reach = std::numeric_limits<double>::infinity();
  for (std::uint32_t p = 0; p < complex_.size() && p < standing_.size(); ++p) {
    LookUp(p);
    const auto& cell = complex_.cell(p);
    if (!cell.bounded()) continue;
    certificate.inconsistent_simplices += CountInconsistent<K>(complex_, p);
    certificate.max_circumradius =
        std::max(certificate.max_circumradius, std::sqrt(cell.max_norm2()));
    for (std::size_t f = 0; f < cell.facet_count(); ++f) {
      double along[K];
      const double distance2 = 2 * complex_.HalfSpace(p, f, along);
      double along2 = 0;
      for (const double a : along) along2 += a * a;
      const double away = std::sqrt(std::max(distance2 - along2, 0.0));
      if (IsTelling(std::sqrt(distance2), away, spec_.epsilon, kLikelyError * spec_.epsilon))
        reach = std::min(reach, distance2 / (2 * away));
    }
  }
  if (std::isinf(reach)) {
    certificate.warnings.push_back(
        Message("no star could be closed: epsilon ", Brief(spec_.epsilon),
                " may be far too coarse for the manifold, or the manifold not closed or not ", K,
                "-dimensional."));
    return;
  }
  certificate.estimated_reach = reach;
  certificate.epsilon_over_reach = spec_.epsilon / reach;
  if (spec_.epsilon > kCoarse * reach)
    certificate.warnings.push_back(TooCoarse(spec_.epsilon / reach, reach, "") + ".");
}

// What still breaks a rule, for people.
template <int K>
std::string Refinement<K>::WhatIsLeft() const {
  std::string left;
  if (!active_.empty())
    left = Message(active_.size(), " stars break rule R1 or R2, one of them that of vertex ",
                   active_.front().star, "; ");
  left += Message(report_.certificate.inconsistent_simplices, " simplices are inconsistent");
  for (std::uint32_t p = 0; p < complex_.size(); ++p) {
    LookUp(p);
    const auto found = FindInconsistentConfiguration<K>(complex_, p);
    if (!found) continue;
    left += Message(", the first in the star of vertex ", found->holder, " but not in that of ",
                    found->refuser);
    if (found->nearer) left += Message(", where vertex ", *found->nearer, " is nearer");
    break;
  }
  return left + "; try a smaller epsilon";
}

template <int K>
void Refinement<K>::UpdateProgress() {
  progress_.vertices = complex_.size();
  progress_.simplices = SimplexCount();
  if (over_) {
    progress_.phase = Phase::kDone;
    progress_.fraction = report_.termination == Termination::kConverged ? 1 : progress_.fraction;
    return;
  }
  progress_.phase = stage_ == Stage::kCertify ? Phase::kCertifying
                    : complex_.size() == 0    ? Phase::kSeeding
                                              : Phase::kRefining;
  progress_.bad_size = progress_.bad_radius_edge = progress_.unbounded_stars = 0;
  // A cell of circumradius R will have to hold about (R / epsilon)^k / 2 more points.
  double missing = 0;
  std::size_t step = 0;
  for (const Active& a : active_) {
    LookUp(step++);
    const double ratio = a.violation.radius / SizeBound(a.star);
    progress_.unbounded_stars += !complex_.cell(a.star).bounded();
    ++(a.violation.rule == Rule::kSize ? progress_.bad_size : progress_.bad_radius_edge);
    missing += 0.5 * std::pow(std::max(ratio, 1.0), K);
  }
  missing += static_cast<double>(blemished_.size());
  const double have = static_cast<double>(complex_.size());
  const double share = stage_ == Stage::kCertify ? 0.99 : 0.98 * have / (have + missing + 1);
  progress_.fraction = std::max(progress_.fraction, share);
}

template <int K>
Eigen::MatrixXd Refinement<K>::Points() const {
  return Eigen::Map<const Eigen::MatrixXd>(complex_.points().data(), complex_.d(), complex_.size());
}

#define STELLATE_INSTANTIATE(K)                                       \
  template void Refinement<K>::HandOutFilled();                       \
  template double Refinement<K>::MaxAgreedNorm2(std::uint32_t) const; \
  template void Refinement<K>::StartCertificate();                    \
  template void Refinement<K>::Fail(Status);                          \
  template void Refinement<K>::DescribeUnfinished();                  \
  template std::string Refinement<K>::WhatIsLeft() const;             \
  template void Refinement<K>::Finish(Termination);                   \
  template void Refinement<K>::UpdateProgress();                      \
  template Eigen::MatrixXd Refinement<K>::Points() const;
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
