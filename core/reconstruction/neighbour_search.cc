#include "core/reconstruction/neighbour_search.h"

#include <algorithm>
#include <cmath>

#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// How much farther than a bunch's neighbours those of the next are looked for.
constexpr double kFarther = 1.1;

}  // namespace

void BunchNeighbours::Gather(const BallTree::Bunch& bunch) {
  reach_ = kFarther * std::sqrt(farthest_);
  if (reach_ == 0) {
    const int found = FindNearest(points_.tree(), points_.Point(bunch.ids[0]),
                                  static_cast<int>(count_), near_.data());
    reach_ = kFarther * std::sqrt(near_[static_cast<std::size_t>(found) - 1].first);
  }
  farthest_ = 0;
  ids_.clear();
  points_.tree().GatherAround(bunch, reach_, &ids_);
  const std::size_t d = points_.coordinates().size() / points_.size();
  coordinates_.resize(d * ids_.size());
  for (std::size_t i = 0; i < ids_.size(); ++i)
    for (std::size_t j = 0; j < d; ++j)
      coordinates_[j * ids_.size() + i] = points_.Point(ids_[i])[j];
  distances2_.resize(ids_.size());
}

template <int D>
void BunchNeighbours::MeasureFrom(const double* point, int any_d) {
  const std::size_t count = ids_.size();
  double* const distances2 = distances2_.data();
  if constexpr (D > 0) {
    const double* const coordinates = coordinates_.data();
    const double origin[D] = {};
    for (std::size_t i = 0; i < count; ++i) {
      double away[D];  // its squares are summed up in SquaredDistance's order
      for (std::size_t j = 0; j < D; ++j) away[j] = coordinates[j * count + i] - point[j];
      distances2[i] = SquaredDistance(away, origin, D);
    }
  } else {
    for (std::size_t i = 0; i < count; ++i)
      distances2[i] = SquaredDistance(point, points_.Point(ids_[i]), any_d);
  }
}

Neighbours BunchNeighbours::Of(std::uint32_t p) {
  const int d = static_cast<int>(points_.coordinates().size() / points_.size());
  WithDimension(d, [&](auto known) { MeasureFrom<known()>(points_.Point(p), d); });
  near_.clear();
  for (std::size_t i = 0; i < ids_.size(); ++i)
    if (distances2_[i] <= reach_ * reach_) near_.emplace_back(distances2_[i], ids_[i]);
  if (near_.size() >= count_) {
    const auto end = near_.begin() + static_cast<std::ptrdiff_t>(count_);
    if (near_.size() > count_) std::nth_element(near_.begin(), end - 1, near_.end());
    std::sort(near_.begin(), end);
    near_.resize(count_);
  } else {
    near_.resize(count_);
    near_.resize(static_cast<std::size_t>(
        FindNearest(points_.tree(), points_.Point(p), static_cast<int>(count_), near_.data())));
  }
  farthest_ = std::max(farthest_, near_.back().first);
  return near_;
}

NeighbourSearch::NeighbourSearch(const std::vector<double>& points, int d) : points_(d) {
  for (std::size_t at = 0; at < points.size(); at += static_cast<std::size_t>(d))
    points_.AddUnindexed(points.data() + at);
  points_.Index(BallTree::Halving::kExtent);
  bunches_ = points_.tree().Bunches();
}

}  // namespace stellate::core
