#include "core/reconstruction/added_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/base/infinity.h"
#include "core/base/vector_ops.h"
#include "core/reconstruction/quadric_fit.h"

namespace stellate::core {
namespace {

// In local spacings, how far from all others a point must be, at least.
constexpr double kClearance = 0.1;
// So many of the points around are looked at: pairs of them are as many as there are time for.
constexpr std::size_t kMostAround = 40;
// The quadric is drawn to the point itself by a part of its height; so often it is moved there.
constexpr int kMoves = 16;

// The squared distance to the nearest of some points.
double Distance2(const FittedCloud& cloud, const std::vector<double>& x,
                 std::span<const std::uint32_t> others) {
  double least = kInfinity;
  for (const std::uint32_t q : others)
    least = std::min(least, SquaredDistance(x.data(), cloud.Position(q), cloud.d));
  return least;
}

}  // namespace

std::optional<std::vector<double>> FindEmptiest(const FittedCloud& cloud,
                                                std::span<const std::uint32_t> around) {
  around = around.first(std::min(around.size(), kMostAround));
  // Who may be nearest: these points, and theirs.
  std::vector<std::uint32_t> others(around.begin(), around.end());
  for (const std::uint32_t p : around)
    others.insert(others.end(), cloud.Near(p).begin(), cloud.Near(p).end());
  std::sort(others.begin(), others.end());
  others.erase(std::unique(others.begin(), others.end()), others.end());
  const auto d = static_cast<std::size_t>(cloud.d);
  std::vector<double> x(d), best, spacings;
  double farthest2 = 0;
  const auto consider = [&](std::span<const std::uint32_t> ids) {
    std::fill(x.begin(), x.end(), 0.0);
    for (const std::uint32_t p : ids)
      for (std::size_t i = 0; i < d; ++i)
        x[i] += cloud.Position(p)[i] / static_cast<double>(ids.size());
    const double distance2 = Distance2(cloud, x, others);
    if (!(distance2 > farthest2)) return;
    farthest2 = distance2;
    best = x;
  };
  consider(around);
  for (std::size_t i = 0; i < around.size(); ++i) {
    spacings.push_back(cloud.spacing[around[i]]);
    for (std::size_t j = 0; j < i; ++j)
      consider(std::array<std::uint32_t, 2>{around[i], around[j]});
  }
  const double clearance = kClearance * Median(std::move(spacings));
  if (!(farthest2 > clearance * clearance)) return std::nullopt;
  return best;
}

void AddPoint(const BallTree& tree, const std::vector<double>& position, FittedCloud* cloud) {
  const std::uint32_t id = cloud->size++;
  const auto d = static_cast<std::size_t>(cloud->d);
  cloud->positions.insert(cloud->positions.end(), position.begin(), position.end());
  double* const x = cloud->positions.data() + id * d;
  QuadricFit fit(cloud->k, cloud->d);
  std::vector<std::pair<double, std::uint32_t>> near(cloud->near_count);
  for (int move = 0; move <= kMoves; ++move) {
    near[0] = {0, id};
    const int found =
        FindNearest(tree, x, static_cast<int>(cloud->near_count) - 1, near.data() + 1);
    fit.Fit(cloud->positions.data(), Neighbours(near.data(), static_cast<std::size_t>(found) + 1),
            nullptr);
    if (move == kMoves) break;
    for (std::size_t i = 0; i < d; ++i) x[i] += fit.step()[static_cast<Eigen::Index>(i)];
  }
  cloud->tangents.insert(cloud->tangents.end(), fit.tangent().begin(), fit.tangent().end());
  const std::uint32_t nearest = near[1].second;
  cloud->spacing.push_back(cloud->spacing[nearest]);
  cloud->nearest.push_back(std::sqrt(near[1].first));
  cloud->noise.push_back(cloud->noise[nearest]);
  cloud->height.push_back(0);
  cloud->kurtosis.push_back(3);
  cloud->extents.push_back(0);
  cloud->smoothed.push_back(0);
  for (const auto& [distance2, q] : near) cloud->near.push_back(q);
}

void RemovePoint(std::uint32_t p, FittedCloud* cloud) {
  const auto remove = [p](auto* values, std::size_t each) {
    const auto at = values->begin() + static_cast<std::ptrdiff_t>(p * each);
    values->erase(at, at + static_cast<std::ptrdiff_t>(each));
  };
  const auto d = static_cast<std::size_t>(cloud->d), k = static_cast<std::size_t>(cloud->k);
  remove(&cloud->positions, d);
  remove(&cloud->tangents, d * k);
  for (auto* values :
       {&cloud->spacing, &cloud->nearest, &cloud->noise, &cloud->height, &cloud->kurtosis})
    remove(values, 1);
  remove(&cloud->extents, 1);
  remove(&cloud->smoothed, 1);
  remove(&cloud->near, cloud->near_count);
  --cloud->size;
  // No point but itself has an added one among its neighbours.
  for (std::uint32_t q = p; q < cloud->size; ++q)
    cloud->near[std::size_t{q} * cloud->near_count] = q;
}

}  // namespace stellate::core
