#include "core/index/runs.h"

#include <algorithm>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

constexpr std::size_t kMostPoints = 32;
// More than rounding can take from a distance in R^d, d up to thousands.
constexpr double kRoundedUp = 1 + 1e-12;

}  // namespace

Runs::Runs(std::span<const double> points, int d, double reach, std::span<const double> shares)
    : stride_(static_cast<std::size_t>(d)) {
  const std::size_t count = points.size() / stride_;
  const auto at = [&](std::size_t i) { return points.data() + i * stride_; };
  for (std::size_t begin = 0, end; begin < count; begin = end) {
    CheckInterruption(begins_.size());
    begins_.push_back(begin);
    const double far = shares.empty() ? reach : reach * shares[begin];
    for (end = begin + 1; end < count && end < begin + kMostPoints; ++end)
      if (!(SquaredDistance(at(begin), at(end), d) <= far * far)) break;
  }
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
