#include "core/boundary/wall_bends.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"

namespace stellate::core {
namespace {

// Conormals may be wrong by some 11 degrees each (core/run/wall_check.cc).
constexpr double kTellingDegrees = 23;
// A neighbour across a thin part of M is no bend: each is behind the other by most of their
// distance. A neighbour so far behind, or in front, is on another sheet, or the piece of the wall
// is too small.
constexpr double kBehind = 0.8;

template <int K>
Eigen::Map<const Eigen::VectorXd> PointOf(const Stars<K>& stars, std::uint32_t p) {
  return {stars.sample().Point(p), stars.sample().d()};
}

template <int K>
Eigen::VectorXd ConormalOf(const Stars<K>& stars, std::uint32_t p) {
  const Eigen::Map<const Eigen::MatrixXd> tangents(stars.sample().Tangent(p), stars.sample().d(),
                                                   K);
  return tangents * Eigen::Map<const Eigen::Matrix<double, K, 1>>(stars.sample().Conormals(p));
}

// Whether q, on p's wall, may be on the same piece of it.
template <int K>
bool IsAlong(const Stars<K>& stars, std::uint32_t p, std::uint32_t q) {
  const Eigen::VectorXd here = ConormalOf<K>(stars, p), there = ConormalOf<K>(stars, q);
  const Eigen::VectorXd step = PointOf<K>(stars, q) - PointOf<K>(stars, p);
  const double off = std::max(std::abs(step.dot(here)), std::abs(step.dot(there)));
  return here.dot(there) >= 0 && off <= kBehind * step.norm();
}

// Whether a vertex on exactly one wall has no neighbour within `far` on the same piece of it. False
// for all other vertices.
template <int K>
bool IsAlone(const Stars<K>& stars, std::uint32_t p, double far) {
  if (K == 1 || CountWalls(stars.sample().walls(p)) != 1) return false;
  for (std::size_t f = 0; f < stars.cell(p).facet_count(); ++f) {
    const std::uint32_t q = stars.cell(p).id(f);
    if (!IsSample(q) || !IsSubset(stars.sample().walls(p), stars.sample().walls(q)) ||
        (PointOf<K>(stars, p) - PointOf<K>(stars, q)).norm() > far)
      continue;
    if (stars.sample().walls(q) != stars.sample().walls(p) || IsAlong<K>(stars, p, q)) return false;
  }
  return true;
}

}  // namespace

double WallBend::radius() const {
  return length / (2 * std::sin(degrees * std::numbers::pi / 360));
}

template <int K>
std::optional<WallBend> SharpestBend(const Stars<K>& stars, double far) {
  std::optional<WallBend> sharpest;
  for (const std::uint32_t p : stars.sample().boundary()) {
    CheckInterruption(p);
    if (CountWalls(stars.sample().walls(p)) != 1) continue;
    const auto& cell = stars.cell(p);
    const bool is_alone = IsAlone<K>(stars, p, far);
    for (std::size_t f = 0; f < cell.facet_count(); ++f) {
      const std::uint32_t q = cell.id(f);
      if (!IsSample(q) || q <= p || stars.sample().walls(q) != stars.sample().walls(p)) continue;
      const Eigen::VectorXd here = ConormalOf<K>(stars, p), there = ConormalOf<K>(stars, q);
      const double sine = (here - there).norm() / 2;  // of half the angle
      const double degrees = 2 * std::asin(std::min(sine, 1.0)) * 180 / std::numbers::pi;
      const Eigen::VectorXd step = PointOf<K>(stars, q) - PointOf<K>(stars, p);
      const double length = step.norm();
      const bool is_behind = std::max(step.dot(here), -step.dot(there)) < -kBehind * length;
      if (degrees < kTellingDegrees || is_behind) continue;
      WallBend bend{std::countr_zero(stars.sample().walls(p)), degrees, length, {}};
      if (sharpest && sharpest->radius() <= bend.radius()) continue;
      if (is_alone != IsAlone<K>(stars, q, far)) continue;
      bend.point = PointOf<K>(stars, p) + step / 2;
      sharpest = std::move(bend);
    }
  }
  return sharpest;
}

template <int K>
std::optional<std::uint32_t> LoneVertex(const Stars<K>& stars, double far) {
  for (const std::uint32_t p : stars.sample().boundary()) {
    CheckInterruption(p);
    if (IsAlone<K>(stars, p, far)) return p;
  }
  return std::nullopt;
}

template <int K>
std::optional<NearCorners> NearestCorners(const Stars<K>& stars) {
  if (K == 1) return std::nullopt;
  std::vector<std::uint32_t> corners;
  for (const std::uint32_t p : stars.sample().boundary())
    if (stars.sample().Codimension(stars.sample().walls(p)) >= K) corners.push_back(p);
  std::optional<NearCorners> nearest;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    CheckInterruption(i);
    for (std::size_t j = 0; j < i; ++j) {
      const double distance = Distance(stars.sample().Point(corners[j]),
                                       stars.sample().Point(corners[i]), stars.sample().d());
      if (!nearest || distance < nearest->distance) nearest = {corners[j], corners[i], distance};
    }
  }
  return nearest;
}

#define STELLATE_EACH(K)                                                     \
  template std::optional<NearCorners> NearestCorners<K>(const Stars<K>&);    \
  template std::optional<WallBend> SharpestBend<K>(const Stars<K>&, double); \
  template std::optional<std::uint32_t> LoneVertex<K>(const Stars<K>&, double);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
