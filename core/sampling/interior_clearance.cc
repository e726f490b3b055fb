#include "core/sampling/interior_clearance.h"

#include <cmath>

#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// How far any point of a wall is from its nearest vertices, in epsilon: R1 bounds it in tangent
// spaces, walls bend.
constexpr double kWallCovering = 1.25;
// Interior points keep this many of their spacings from the faces' vertices. A smaller distance
// makes more slivers, a larger one more vertices; the difference is small from 0.5 to 0.8, since
// interior points must not encroach on the faces anyway.
constexpr double kFromFaces = 0.66;

}  // namespace

template <int K>
InteriorClearance<K>::InteriorClearance(const Engine<K>& engine, double spacing)
    : stars_(engine.stars()), epsilon_(engine.criteria().epsilon), apart_(kFromFaces * spacing) {}

template <int K>
bool InteriorClearance<K>::IsClear(const double* point) const {
  return !stars_.sample().AnyWithin(point, apart_) && !stars_.sample().InProtectingBall(point) &&
         !stars_.EncroachedBy(point, 0);
}

template <int K>
std::vector<std::uint8_t> InteriorClearance<K>::AreClear(
    const Eigen::MatrixXd& points, const std::vector<std::uint8_t>& found) const {
  std::vector<std::uint8_t> have(found.size());
  ParallelFor(found.size(), [&](std::size_t i) {
    have[i] = found[i] && IsClear(points.col(static_cast<Eigen::Index>(i)).data());
  });
  return have;
}

// The wall's point between the two ends is nearest to both if it is in the middle.
template <int K>
bool InteriorClearance<K>::IsSurelyInside(const double* point, double reach) const {
  const double covering = kWallCovering * epsilon_;
  return !stars_.sample().AnyWithin(point, std::sqrt(covering * covering + reach * reach / 4));
}

template <int K>
bool InteriorClearance<K>::KnowsWallNear(const double* point, double reach) const {
  return stars_.sample().AnyWithin(point, kWallCovering * epsilon_ + reach);
}

STELLATE_INSTANTIATE_CLASS(InteriorClearance)

}  // namespace stellate::core
