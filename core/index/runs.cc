#include "core/index/runs.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

constexpr std::size_t kMostPoints = 32;
// More than rounding can take from a distance in R^d, d up to thousands.
constexpr double kRoundedUp = 1 + 1e-12;
// Points of a stretch that is cut into runs on its own.
constexpr std::size_t kStretch = 4096;

// Returns 0, next(0), next(next(0)) and so on, as far as they are below `count`. Follows chains
// from the beginnings of all stretches in parallel: the whole one mostly meets each soon, and is
// the same from there on.
template <typename Next>
std::vector<std::size_t> Chain(std::size_t count, const Next& next) {
  std::vector<std::vector<std::size_t>> chains((count + kStretch - 1) / kStretch);
  ParallelFor(chains.size(), [&](std::size_t s) {
    const std::size_t last = std::min(count, (s + 1) * kStretch);
    for (std::size_t i = s * kStretch; i < last; i = next(i)) chains[s].push_back(i);
  });
  std::vector<std::size_t> whole;
  std::size_t i = 0;
  for (std::size_t s = 0; s < chains.size(); ++s) {
    CheckInterruption(s);
    const std::size_t last = std::min(count, (s + 1) * kStretch);
    auto met = chains[s].begin();
    for (; i < last; i = next(i)) {
      met = std::lower_bound(met, chains[s].end(), i);
      if (met != chains[s].end() && *met == i) break;
      whole.push_back(i);
    }
    if (i >= last) continue;
    whole.insert(whole.end(), met, chains[s].end());
    i = next(whole.back());
  }
  return whole;
}

}  // namespace

Runs::Runs(std::span<const double> points, int d, double reach, std::span<const double> shares)
    : stride_(static_cast<std::size_t>(d)) {
  const std::size_t count = points.size() / stride_;
  const auto at = [&](std::size_t i) { return points.data() + i * stride_; };
  begins_ = Chain(count, [&](std::size_t begin) {
    const double far = shares.empty() ? reach : reach * shares[begin];
    std::size_t end = begin + 1;
    while (end < count && end < begin + kMostPoints &&
           SquaredDistance(at(begin), at(end), d) <= far * far)
      ++end;
    return end;
  });
  centres_.assign(begins_.size() * stride_, 0.0);
  radii_.assign(begins_.size(), 0.0);
  begins_.push_back(count);
  ParallelFor(radii_.size(), [&](std::size_t run) {
    double* const centre = centres_.data() + run * stride_;
    for (std::size_t i = begin(run); i < end(run); ++i)
      for (std::size_t j = 0; j < stride_; ++j) centre[j] += at(i)[j];
    for (std::size_t j = 0; j < stride_; ++j)
      centre[j] /= static_cast<double>(end(run) - begin(run));
    for (std::size_t i = begin(run); i < end(run); ++i)
      radii_[run] = std::max(radii_[run], Distance(at(i), centre, d));
  });
}

RunTree::RunTree(std::span<const double> points, int d, double reach,
                 std::span<const double> shares)
    : d_(d), points_(points), runs_(points, d, reach, shares), tree_(d, &runs_.centres()) {
  tree_.Assign(runs_.radii(), BallTree::Halving::kExtent);
}

void RunTree::Gather(const double* q, double radius, std::vector<std::uint32_t>* ids) const {
  thread_local std::vector<std::uint32_t> near;
  near.clear();
  const double far = kRoundedUp * radius;
  tree_.Gather(q, far, &near);
  WithDimension(d_, [&](auto known) {
    const auto stride = static_cast<std::size_t>(known() > 0 ? known() : d_);
    for (const std::uint32_t run : near) {
      const std::size_t end = runs_.end(run);
      const double* p = points_.data() + runs_.begin(run) * stride;
      for (std::size_t i = runs_.begin(run); i < end; ++i, p += stride)
        if (SquaredDistance(q, p, static_cast<int>(stride)) <= far * far)
          ids->push_back(static_cast<std::uint32_t>(i));
    }
  });
}

}  // namespace stellate::core
