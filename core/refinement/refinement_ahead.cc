// Asking ahead: the refinement is rehearsed on a surrogate of M, and all that it would insert is
// asked for in one batch. Only the rules, checked on true points, decide when the run is over.

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/refinement/refinement.h"
#include "core/refinement/surrogate.h"

namespace stellate::core {
namespace {

// Fewer targets than this, or than this share of the stars, are asked for as they are.
constexpr std::size_t kLeastTargets = 20;
constexpr double kLeastShare = 0.02;
// R3 and R4 are rehearsed for so many rounds: what is inconsistent on the surrogate is mostly
// inconsistent on M, but not to the last simplex.
constexpr int kRehearsedGoodPointRounds = 6;
// True points fall elsewhere than predicted: one that comes nearer to another than this share of
// the spacing that was planned for it would cost quality.
constexpr double kKeptSpacing = 0.5;
// After a rehearsal that brought little, wait until the sample has grown by this factor.
constexpr double kPatience = 1.5;

}  // namespace

template <int K>
Refinement<K>::Refinement(const Specification& spec, const StarComplex<K>& sample)
    : spec_(spec),
      criteria_(Resolve(spec_)),
      complex_(spec_.ambient_dimension, spec_.epsilon, sample.inradius(), sample.judging()),
      rehearsal_(true),
      tangent_finder_(K, spec_.ambient_dimension, spec_.epsilon, spec_.random_seed) {
  for (std::uint32_t p = 0; p < sample.size(); ++p)
    complex_.Append(sample.Point(p), sample.Tangent(p));
  Commit();
  Plan();
}

// Whether the batch of the next round was planned so.
template <int K>
bool Refinement<K>::AskAhead(std::size_t targets) {
  const std::uint32_t count = complex_.size();
  if (count < ask_ahead_from_ || targets < kLeastTargets ||
      static_cast<double>(targets) < kLeastShare * count)
    return false;
  for (const Active& a : active_)
    if (!complex_.cell(a.star).bounded()) return false;  // the front has its own pace

  const Surrogate<K> surrogate(complex_);
  Specification spec = spec_;
  spec.oracle = {.intersect_flat = false, .tangent_basis = true};
  spec.criteria.ask_ahead = false;
  spec.limits.max_rounds = std::numeric_limits<std::uint64_t>::max();
  Refinement rehearsal(spec, complex_);
  for (int good_rounds = 0; good_rounds < kRehearsedGoodPointRounds;) {
    const QueryBatch* batch = rehearsal.NextBatch();
    if (!batch) break;
    Answers answers;
    for (const QueryBlock& block : batch->blocks) answers.blocks.push_back(surrogate.Answer(block));
    if (!rehearsal.Absorb(answers)) break;
    good_rounds += !rehearsal.all_suspect_;
  }
  const std::uint32_t wanted = rehearsal.complex_.size() - count;
  if (wanted <= targets) {
    ask_ahead_from_ = static_cast<std::uint32_t>(kPatience * count);
    return false;
  }

  const int d = complex_.d();
  QueryBlock block;
  block.want_tangents = spec_.oracle.tangent_basis;
  block.points.resize(d, wanted);
  predicted_tangents_.resize(d * K, wanted);
  predicted_spacing_.resize(wanted);
  for (std::uint32_t i = 0; i < wanted; ++i) {
    const std::uint32_t p = count + i;
    std::copy_n(rehearsal.complex_.Point(p), d, block.points.col(i).data());
    std::copy_n(rehearsal.complex_.Tangent(p), d * K, predicted_tangents_.col(i).data());
    double nearest2 = INFINITY;
    for (const auto& facet : rehearsal.complex_.cell(p).facets())
      nearest2 = std::min(nearest2, 2 * facet.offset);
    predicted_spacing_[i] = std::sqrt(nearest2);
  }
  purpose_ = Purpose::kAhead;
  AskAgain(block, Stage::kPoints);
  return true;
}

template <int K>
void Refinement<K>::InsertAhead() {
  for (Eigen::Index c = 0; c < points_.cols(); ++c) {
    if (complex_.size() >= spec_.limits.max_vertices) break;
    if (!found_[static_cast<std::size_t>(c)]) continue;
    if (complex_.AnyWithin(points_.col(c).data(), kKeptSpacing * predicted_spacing_[c])) {
      ++report_.counts.duplicates;
      continue;
    }
    complex_.Append(points_.col(c).data(), tangents_.col(c).data());
    ++report_.counts.inserted_size;
  }
  predicted_tangents_.resize(0, 0);
}

#define STELLATE_INSTANTIATE(K)                                                              \
  template Refinement<K>::Refinement(const Specification&, const StarComplex<K>&);           \
  template bool Refinement<K>::AskAhead(std::size_t);                                        \
  template void Refinement<K>::InsertAhead();
STELLATE_INSTANTIATE(1)
STELLATE_INSTANTIATE(2)
STELLATE_INSTANTIATE(3)
STELLATE_INSTANTIATE(4)
STELLATE_INSTANTIATE(5)
#undef STELLATE_INSTANTIATE

}  // namespace stellate::core
