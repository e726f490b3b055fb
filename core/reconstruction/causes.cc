#include "core/reconstruction/causes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <span>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/index/indexed_points.h"
#include "core/reconstruction.h"

namespace stellate::core {
namespace {

// In local spacings.
constexpr double kNoisy = 0.5;      // the standard deviation of a coordinate
constexpr double kClose = 0.1;      // to the nearest point
constexpr double kOutlier = 1;      // over the fitted quadric
constexpr double kSheetFrom = 0.3;  // where another sheet is looked for
constexpr double kSheetTo = 2;
// And in standard deviations: what noise alone makes is no outlier.
constexpr double kOutlierDeviations = 4;
// A point this steeply above a tangent space, as a share of its distance, is on another sheet where
// the tangent spaces are nearly parallel: sin^2 of 30 degrees.
constexpr double kSteep = 0.5;
// And farther above it, in standard deviations, than noise often moves a point.
constexpr double kSheetDeviations = 2.5;
constexpr double kParallel2 = 0.25;
// An outlier is this high over the tangent spaces at its neighbours, in local spacings; and in
// heights of its neighbours over those around them, which are as high where M itself bends.
constexpr double kOutlying = 0.5;
constexpr double kOutlyingAlone = 3;
// How far an outlier's star may reach, in local spacings: one that reaches farther is open.
constexpr double kOutlyingReach = 8;
// sin^2 of 60 degrees.
constexpr double kTurned2 = 0.75;
// Residuals on two sheets, midway between normal ones, 3, cut short by the fit, and two values, 1.
constexpr double kTwoSheets = 1.5;

// Tangent spaces at nearest neighbours differ by some 15 and 25 degrees where the spacing is 0.35
// and 0.6 of M's radius of curvature. Beyond the first, stars may disagree because the points are
// too few; beyond the second, a quadric does not tell bends of M from outliers. sin^2.
constexpr double kThin2 = 0.067;
constexpr double kCoarse2 = 0.1786;

// The cosines between the tangent vectors at two points.
Eigen::MatrixXd CosinesBetween(const FittedCloud& cloud, std::uint32_t p, std::uint32_t q) {
  Eigen::MatrixXd cosines(cloud.k, cloud.k);
  for (int a = 0; a < cloud.k; ++a)
    for (int b = 0; b < cloud.k; ++b)
      cosines(a, b) = Dot(cloud.Tangent(p) + a * cloud.d, cloud.Tangent(q) + b * cloud.d, cloud.d);
  return cosines;
}

// The squared sine of the largest angle between two tangent spaces.
double Turn2(const FittedCloud& cloud, std::uint32_t p, std::uint32_t q) {
  const Eigen::MatrixXd cosines = CosinesBetween(cloud, p, q);
  return 1 - EigenvaluesOfSymmetric(cosines.transpose() * cosines)[0];
}

// Whether it is above a bound. The sum of all squared sines, which is soon computed, decides most
// often.
bool TurnsBy(double sine2, const FittedCloud& cloud, std::uint32_t p, std::uint32_t q) {
  double sum = cloud.k, cosines[kMaxReconstructionDimension];
  const auto k = static_cast<std::size_t>(cloud.k);
  for (int a = 0; a < cloud.k; ++a) {
    DotRows(cloud.Tangent(q), k, cloud.Tangent(p) + a * cloud.d, cloud.d, cosines);
    for (std::size_t b = 0; b < k; ++b) sum -= cosines[b] * cosines[b];
  }
  if (!(sum > sine2) || cloud.k == 1) return sum > sine2;
  return Turn2(cloud, p, q) > sine2;
}

// The nearest neighbours of a point: as many as directions.
std::span<const std::uint32_t> Nearest(const FittedCloud& cloud, std::uint32_t p) {
  return cloud.Near(p).subspan(
      1, std::min<std::size_t>(cloud.near_count - 1, static_cast<std::size_t>(2 * cloud.k)));
}

// By how much tangent spaces turn from one point to the next, as squared sines, where they are
// those of the given points; 0 where these were smoothed. Medians over the points around, in which
// the few that an outlier turns do not show.
std::vector<double> MeasureTurns(const FittedCloud& cloud) {
  std::vector<double> turns(cloud.size), medians(cloud.size);
  ParallelFor(cloud.size, [&](std::uint32_t p) {
    std::vector<double> own;
    for (const std::uint32_t q : Nearest(cloud, p)) own.push_back(Turn2(cloud, p, q));
    turns[p] = Median(std::move(own));
  });
  ParallelFor(cloud.size, [&](std::uint32_t p) {
    if (cloud.smoothed[p]) return;
    std::vector<double> around;
    for (const std::uint32_t q : cloud.Near(p)) around.push_back(turns[q]);
    medians[p] = Median(std::move(around));
  });
  return medians;
}

bool HasSheetNear(const FittedCloud& cloud, std::uint32_t p) {
  if (cloud.kurtosis[p] < kTwoSheets) return true;
  const double h = cloud.spacing[p];
  std::vector<double> step(static_cast<std::size_t>(cloud.d));
  for (const std::uint32_t q : cloud.Near(p)) {
    const double *a = cloud.Position(p), *b = cloud.Position(q);
    for (int i = 0; i < cloud.d; ++i) step[static_cast<std::size_t>(i)] = b[i] - a[i];
    const double distance2 = Dot(step.data(), step.data(), cloud.d);
    if (distance2 < kSheetFrom * kSheetFrom * h * h || distance2 > kSheetTo * kSheetTo * h * h)
      continue;
    double along2 = 0;
    for (int e = 0; e < cloud.k; ++e) {
      const double along = Dot(cloud.Tangent(p) + e * cloud.d, step.data(), cloud.d);
      along2 += along * along;
    }
    const double above2 = distance2 - along2;
    const double noise = kSheetDeviations * cloud.noise[p];
    if (above2 > kSteep * kSteep * distance2 && above2 > noise * noise &&
        !TurnsBy(kParallel2, cloud, p, q))
      return true;
  }
  return false;
}

// Whether residuals are larger than those of points near a smooth manifold.
bool IsUneven(const FittedCloud& cloud, std::uint32_t p) {
  return cloud.noise[p] > kNoisy * cloud.spacing[p];
}
bool IsHigh(const FittedCloud& cloud, std::uint32_t p) {
  return cloud.height[p] >
         std::max(kOutlier * cloud.spacing[p], kOutlierDeviations * cloud.noise[p]);
}

// How high p is over the tangent spaces at its neighbours: the median, length. Unlike that over the
// quadric around p it is not drawn towards p.
double HeightOverNeighbours(const FittedCloud& cloud, std::uint32_t p) {
  std::vector<double> heights, step(static_cast<std::size_t>(cloud.d));
  for (const std::uint32_t q : cloud.Near(p).subspan(1)) {
    const double *a = cloud.Position(q), *b = cloud.Position(p);
    for (int i = 0; i < cloud.d; ++i) step[static_cast<std::size_t>(i)] = b[i] - a[i];
    double above2 = Dot(step.data(), step.data(), cloud.d);
    for (int e = 0; e < cloud.k; ++e) {
      const double along = Dot(cloud.Tangent(q) + e * cloud.d, step.data(), cloud.d);
      above2 -= along * along;
    }
    heights.push_back(std::sqrt(std::max(0.0, above2)));
  }
  return Median(std::move(heights));
}

// Marks outliers and the points that their stars may reach: where these are not resolved, it is
// because of the outlier. The star of one at height D has the points that are D away from below it.
std::vector<std::uint8_t> FindBesideOutliers(const FittedCloud& cloud) {
  std::vector<double> heights(cloud.size);
  ParallelFor(cloud.size, [&](std::uint32_t p) { heights[p] = HeightOverNeighbours(cloud, p); });
  IndexedPoints points(cloud.d);
  for (std::uint32_t p = 0; p < cloud.size; ++p) points.AddUnindexed(cloud.Position(p));
  points.Index();
  std::vector<std::uint8_t> beside(cloud.size);
  ParallelFor(cloud.size, [&](std::uint32_t p) {
    const double h = cloud.spacing[p];
    if (!(heights[p] > kOutlying * h)) return;
    std::vector<double> around;
    for (const std::uint32_t q : cloud.Near(p).subspan(1)) around.push_back(heights[q]);
    if (!(heights[p] > kOutlyingAlone * Median(std::move(around)))) return;
    const double radius = std::min(2 * (heights[p] + h), kOutlyingReach * h);
    points.tree().VisitNear(
        cloud.Position(p), [&] { return radius; },
        [&](std::uint32_t q, double) {
          std::atomic_ref(beside[q]).store(1, std::memory_order_relaxed);
        });
  });
  return beside;
}

// Marks the vertices of edges along which tangent spaces turn too far.
std::vector<std::uint8_t> FindTurning(const FittedCloud& cloud, const Assembly& assembly) {
  std::vector<std::uint8_t> turning(cloud.size);
  const auto width = static_cast<std::size_t>(cloud.k) + 1;
  const auto test = [&](std::uint32_t p, std::uint32_t q) {
    if (!TurnsBy(kTurned2, cloud, p, q)) return;
    for (const std::uint32_t v : {p, q})
      std::atomic_ref(turning[v]).store(1, std::memory_order_relaxed);
  };
  ParallelFor(assembly.simplices.size() / width, [&](std::size_t s) {
    const std::uint32_t* const ids = assembly.simplices.data() + s * width;
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t j = 0; j < i; ++j) test(ids[i], ids[j]);
  });
  // Unresolved places have fewer simplices, or none.
  ParallelFor(cloud.size, [&](std::uint32_t p) {
    if (assembly.places[p] != Place::kDisagree) return;
    for (const std::uint32_t q : Nearest(cloud, p)) test(p, q);
  });
  return turning;
}

}  // namespace

Causes FindCauses(const FittedCloud& cloud, const Assembly& assembly, bool edges_allowed) {
  const std::vector<std::uint8_t> turning = FindTurning(cloud, assembly);
  const auto& places = assembly.places;
  std::vector<std::uint8_t> beside_outlier(cloud.size);
  std::vector<double> turns(cloud.size);
  if (std::find(places.begin(), places.end(), Place::kDisagree) != places.end()) {
    beside_outlier = FindBesideOutliers(cloud);
    turns = MeasureTurns(cloud);
  }
  Causes causes;
  causes.places.assign(cloud.size, Place::kOk);
  const auto cause_at = [&](std::uint32_t p) {
    const bool resolved = assembly.places[p] != Place::kDisagree;
    // Residuals tell noise from bends only where a quadric is fitted to a small part of M, and
    // noise does not grow with that part.
    const bool tells = (cloud.IsLocal(p) || edges_allowed) && !cloud.misfits;
    if (!(assembly.radii[p] <= OpenRadius(cloud, p)) && !(edges_allowed && resolved))
      return Place::kEdge;
    if (HasSheetNear(cloud, p)) return Place::kSheets;
    if (IsUneven(cloud, p)) return tells ? Place::kNoise : Place::kSparse;
    if (!resolved && turns[p] > kCoarse2) return Place::kSparse;
    if (IsHigh(cloud, p) || (!resolved && beside_outlier[p] != 0)) return Place::kNoise;
    if (turning[p] || (!resolved && turns[p] > kThin2)) return Place::kSparse;
    if (resolved) return Place::kOk;
    return cloud.nearest[p] < kClose * cloud.spacing[p] ? Place::kClose : Place::kDisagree;
  };
  ParallelFor(cloud.size, [&](std::uint32_t p) {
    if (assembly.places[p] != Place::kDropped && assembly.places[p] != Place::kAdded)
      causes.places[p] = cause_at(p);
  });
  for (const Place cause : causes.places) causes.count += cause != Place::kOk;
  return causes;
}

}  // namespace stellate::core
