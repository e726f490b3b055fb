// Asking ahead: the refinement is rehearsed on a surrogate of M, and all that it would insert is
// asked for in one batch. Only the rules, checked on true points, decide when the run is over.

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/parallel.h"
#include "core/refinement/refinement.h"
#include "core/refinement/surrogate.h"

namespace stellate::core {
namespace {

// R3 and R4 are rehearsed for so many rounds: what is inconsistent on the surrogate is mostly
// inconsistent on M, but not to the last simplex.
constexpr int kRehearsedGoodPointRounds = 12;
// True points fall elsewhere than predicted: one that comes nearer to another than this share of
// the spacing that was planned for it would cost quality.
constexpr double kKeptSpacing = 0.95;
// A target is left to the rehearsal when that has a point within this share of its circumradius.
constexpr double kMended = 0.9;
// A rehearsal that wants so many times what seems to be missing is on the wrong track.
constexpr double kMostWanted = 4;

}  // namespace

template <int K>
Refinement<K>::Refinement(const Refinement& original)
    : spec_(original.spec_),
      criteria_(original.criteria_),
      complex_(original.complex_),
      progress_(original.progress_),
      rehearsal_(true),
      whole_rounds_(original.whole_rounds_),
      tangent_finder_(original.tangent_finder_),
      given_size_(original.given_size_),
      size_seen_(original.size_seen_),
      local_size_(original.local_size_),
      sizes_judged_at_(original.sizes_judged_at_),
      sizes_judged_(original.sizes_judged_),
      standing_(original.standing_),
      discouraged_(original.discouraged_),
      no_flat_(original.no_flat_.size()),
      active_(original.active_),
      suspects_(original.suspects_),
      blemished_(original.blemished_),
      all_suspect_(original.all_suspect_),
      before_good_points_(original.before_good_points_) {
  spec_.oracle.intersect_flat = spec_.oracle.tangent_basis = true;
  spec_.limits.max_rounds = std::numeric_limits<std::uint64_t>::max();
  spec_.limits.max_batch_queries = 0;
  criteria_.ask_ahead = false;
  criteria_.flat_alternations = 1;
}

// Answers a rehearsal until it needs no more, or knows no more.
template <int K>
void Refinement<K>::Rehearse(Refinement& rehearsal) const {
  double missing = 0;
  for (std::size_t i = 0; i < active_.size(); ++i) {
    LookUp(i);
    const Active& a = active_[i];
    missing += std::pow(std::max(a.violation.radius / SizeBound(a.star), 1.0), K);
  }
  const double most = complex_.size() + kMostWanted * (missing + complex_.size());
  Surrogate<K> surrogate(complex_, criteria_.advance_step, criteria_.epsilon,
                         criteria_.sizes_given ? given_size_.data() : nullptr);
  rehearsal.Plan();
  for (int good_rounds = 0; good_rounds < kRehearsedGoodPointRounds;) {
    const QueryBatch* batch = rehearsal.NextBatch();
    if (!batch || rehearsal.complex_.size() > most) return;
    Answers answers;
    for (const QueryBlock& block : batch->blocks) answers.blocks.push_back(surrogate.Answer(block));
    good_rounds += rehearsal.targets_.front().violation.rule >= Rule::kSliver;
    if (!rehearsal.Absorb(answers)) return;
  }
}

// Adds what a rehearsal wants to the round; targets that it mends need not be asked for.
template <int K>
void Refinement<K>::AskAhead() {
  const std::uint32_t count = complex_.size();
  Refinement rehearsal(*this);
  Rehearse(rehearsal);
  const StarComplex<K>& rehearsed = rehearsal.complex_;
  const auto wanted = static_cast<Eigen::Index>(rehearsed.size() - count);
  const int d = complex_.d();
  ahead_.points.resize(d, wanted);
  ahead_.tangents.resize(d * K, wanted);
  ahead_.spacing.resize(wanted);
  ahead_.rules = std::move(rehearsal.inserted_rules_);
  for (Eigen::Index i = 0; i < wanted; ++i) {
    LookUp(static_cast<std::size_t>(i));
    const std::uint32_t p = count + static_cast<std::uint32_t>(i);
    std::copy_n(rehearsed.Point(p), d, ahead_.points.col(i).data());
    std::copy_n(rehearsed.Tangent(p), d * K, ahead_.tangents.col(i).data());
    double nearest2 = INFINITY;
    const auto& cell = rehearsed.cell(p);
    for (std::size_t f = 0; f < cell.facet_count(); ++f)
      if (!IsFake(cell.id(f))) nearest2 = std::min(nearest2, rehearsed.EdgeLength2(p, f));
    ahead_.spacing[i] = std::isinf(nearest2) ? criteria_.epsilon : std::sqrt(nearest2);
  }
  std::vector<double> centre(static_cast<std::size_t>(d));
  std::erase_if(targets_, [&, step = std::size_t{0}](const Target<K>& t) mutable {
    LookUp(step++);
    complex_.Lift(t.star, t.x, centre.data());
    bool mended = false;
    rehearsed.ForEachWithin(centre.data(), kMended * t.radius,
                            [&](std::uint32_t p) { mended = mended || p >= count; });
    return mended;
  });
}

template <int K>
void Refinement<K>::InsertAhead() {
  for (Eigen::Index i = 0; i < ahead_.size(); ++i) {
    LookUp(static_cast<std::size_t>(i));
    if (complex_.size() >= spec_.limits.max_vertices) break;
    const Eigen::Index c = first_candidate_.back() + i;
    if (!found_[static_cast<std::size_t>(c)]) continue;
    if (complex_.AnyWithin(points_.col(c).data(), kKeptSpacing * ahead_.spacing[i])) {
      ++report_.counts.duplicates;
      continue;
    }
    Insert(c, ahead_.rules[static_cast<std::size_t>(i)], StarComplex<K>::kNone);
  }
  ahead_failed_ = complex_.size() == delta_.first_vertex;
  ahead_ = {};
}

#define STELLATE_INSTANTIATE(K)                                \
  template Refinement<K>::Refinement(const Refinement&);       \
  template void Refinement<K>::Rehearse(Refinement<K>&) const; \
  template void Refinement<K>::AskAhead();                     \
  template void Refinement<K>::InsertAhead();
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
