#include "core/reconstruction/tiled_stars.h"

#include <algorithm>
#include <cmath>

#include "core/base/infinity.h"
#include "core/base/parallel.h"
#include "core/complex/cavities.h"
#include "core/complex/stars.h"

namespace stellate::core {
namespace {

// In spacings: the size bound, which sets the scale of the perturbing weights and how large a
// simplex is still judged at its common centre; the radius at which a star counts as open; and how
// far out points are expected to cut a star, as a circumradius.
constexpr double kSize = 2;
constexpr double kOpen = 8;
constexpr double kExpected = 1.2;

}  // namespace

template <int K>
TiledStars BuildTiledStars(const FittedCloud& cloud, const TilingRequest& request) {
  const std::vector<std::uint32_t>& ids = request.ids;
  Stars<K> stars(cloud.d, kSize * request.spacing,
                 {.inradius = kOpen * request.spacing, .centre_rule = request.rule});
  for (const std::uint32_t p : ids) {
    stars.AddInBulk(cloud.Position(p), cloud.Tangent(p), kExpected * cloud.spacing[p]);
    stars.NameLast(p);
  }
  stars.Commit();
  if (request.weights) {
    std::vector<double> weights(ids.size());
    for (std::size_t i = 0; i < ids.size(); ++i) weights[i] = (*request.weights)[ids[i]];
    if (std::any_of(weights.begin(), weights.end(), [](double w) { return w > 0; }))
      stars.SetProtectingBalls(std::move(weights));
  }
  FilledCavities filled = FillCavities<K>(stars, {.epsilon = request.tiles ? kInfinity : 0,
                                                  .radius_edge_bound = kInfinity,
                                                  .sliver_bound = 0});
  if (!request.tiles) {
    filled.unfilled.insert(filled.unfilled.end(), filled.tiled.begin(), filled.tiled.end());
    std::sort(filled.unfilled.begin(), filled.unfilled.end());
    filled.tiled.clear();
  }
  TiledStars result;
  result.doubtful = filled.inconsistent;
  result.cavities = filled.cavities;
  result.tiles = filled.filling;
  result.radii.resize(ids.size());
  ParallelFor(ids.size(), [&](std::size_t i) {
    const auto& cell = stars.cell(static_cast<std::uint32_t>(i));
    result.radii[i] = cell.bounded() ? std::sqrt(cell.max_norm2()) : kInfinity;
  });
  for (auto* places : {&filled.simplices, &filled.unfilled, &filled.tiled})
    for (std::uint32_t& id : *places) id = ids[id];
  result.simplices = std::move(filled.simplices);
  result.unfilled = std::move(filled.unfilled);
  result.tiled = std::move(filled.tiled);
  return result;
}

template TiledStars BuildTiledStars<1>(const FittedCloud&, const TilingRequest&);
template TiledStars BuildTiledStars<2>(const FittedCloud&, const TilingRequest&);
template TiledStars BuildTiledStars<3>(const FittedCloud&, const TilingRequest&);

}  // namespace stellate::core
