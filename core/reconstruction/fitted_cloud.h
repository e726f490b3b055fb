#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/function_ref.h"

namespace stellate::core {

// Distinct points, and what the quadrics through their neighbours say of M there. All vectors are
// by point; a point's neighbours begin with itself.
struct FittedCloud {
  int k = 0, d = 0;
  std::uint32_t size = 0;
  std::vector<double> positions;  // d each: the points, or copies moved to the quadrics
  std::vector<double> tangents;   // k rows of d each
  std::vector<double> spacing;    // (volume / points)^(1/k) around, medians over neighbours, length
  std::vector<double> nearest;    // distance to the nearest point, length
  std::vector<double> noise;      // standard deviation of a coordinate, likewise
  std::vector<double> height;     // of the point over the quadric around it, length
  std::vector<double> kurtosis;   // of residuals (QuadricFit), likewise; 3 where not smoothed
  std::vector<std::uint8_t> extents;   // directions in which the points extend alike; 0: not known
  std::vector<std::uint8_t> smoothed;  // whether the position is a copy's
  bool any_smoothed = false;
  // Whether deviations from quadrics grew with the number of neighbours: M bends, and what looks
  // like noise is none.
  bool misfits = false;
  std::uint32_t near_count = 0;      // neighbours that a quadric was fitted to
  std::uint32_t smoothed_count = 0;  // and where the position is a copy's
  std::vector<std::uint32_t> near;   // near_count each, nearest first

  const double* Position(std::uint32_t p) const {
    return positions.data() + std::size_t{p} * static_cast<std::size_t>(d);
  }
  const double* Tangent(std::uint32_t p) const {
    return tangents.data() + std::size_t{p} * static_cast<std::size_t>(d * k);
  }
  // Whether the quadric around p is fitted to a small part of all points. A sixth of them takes up
  // 48 degrees on a sphere, the least bent of closed surfaces.
  bool IsLocal(std::uint32_t p) const {
    return size >= 6 * (smoothed[p] ? smoothed_count : near_count);
  }
  std::span<const std::uint32_t> Near(std::uint32_t p) const {
    return {near.data() + std::size_t{p} * near_count, near_count};
  }
};

// A star of p that reaches farther than this is as good as open, length: of points that are
// independent and uniform, one in millions does. On a curve the star has two edges alone.
inline double OpenRadius(const FittedCloud& cloud, std::uint32_t p) {
  return (cloud.k == 1 ? 8 : 4) * cloud.spacing[p];
}

// How points are fitted.
struct FitRequest {
  int k = 0, d = 0;
  std::span<const double> tangents;  // k rows of d a point, or empty: to be estimated
  std::optional<double> noise;       // as in ReconstructionSpecification
};

// Fits tangent spaces; where the noise is above a small share of the spacing, twice more to more
// neighbours, moving copies of the points to the quadrics. `done`: is called with the share of the
// work that is done. In parallel; the same for any number of threads.
FittedCloud FitCloud(std::vector<double> points, const FitRequest& request,
                     FunctionRef<void(double)> done);

// Returns the median of positive numbers; 0 if there are none.
double Median(std::vector<double> values);

}  // namespace stellate::core
