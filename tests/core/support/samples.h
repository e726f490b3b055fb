#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/basis_layout.h"
#include "core/base/random.h"
#include "core/complex/stars.h"
#include "tests/support/make_manifold.h"

namespace stellate::core::testing {

using stellate::testing::Make;

// Points of R^d with tangent bases as Stars wants them: k rows of d a point.
struct FramedPoints {
  int d = 0, k = 0;
  std::vector<double> points, tangents;

  std::uint32_t size() const {
    return static_cast<std::uint32_t>(points.size() / static_cast<std::size_t>(d));
  }
  const double* Point(std::uint32_t i) const {
    return points.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(d);
  }
  const double* Tangent(std::uint32_t i) const {
    return tangents.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(d * k);
  }
  // bases: (d k) x n laid out as QueryBlock::bases.
  void Append(const Eigen::MatrixXd& new_points, const Eigen::MatrixXd& bases) {
    for (Eigen::Index c = 0; c < new_points.cols(); ++c) {
      points.insert(points.end(), new_points.col(c).begin(), new_points.col(c).end());
      tangents.resize(tangents.size() + static_cast<std::size_t>(d * k));
      ToByVector(bases.col(c).data(), d, k, tangents.data() + tangents.size() - d * k);
    }
  }
};

// Points of the manifold's box, sent to their closest points.
inline Eigen::MatrixXd RandomPointsOn(Manifold& manifold, int count, std::uint64_t seed) {
  const stellate::BoundingBox box = *manifold.bounding_box();
  Random random(seed, 99);
  Eigen::MatrixXd x(manifold.ambient_dimension(), count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (Eigen::Index i = 0; i < x.rows(); ++i)
      x(i, c) = box.lower[i] + random.Uniform() * (box.upper[i] - box.lower[i]);
  return manifold.ClosestPoint(x).points;
}

inline FramedPoints RandomSample(Manifold& manifold, int count, std::uint64_t seed) {
  FramedPoints sample;
  sample.d = manifold.ambient_dimension();
  sample.k = manifold.dimension();
  const Eigen::MatrixXd points = RandomPointsOn(manifold, count, seed);
  sample.Append(points, manifold.TangentBasis(points));
  return sample;
}

// The grid of n^k points of the k-torus (circles of radius 1 in R^2 each): all neighbours are
// cospherical, 2^k at a time. Tangents point along the circles.
inline FramedPoints TorusGrid(int k, int n) {
  FramedPoints sample;
  sample.d = 2 * k;
  sample.k = k;
  int total = 1;
  for (int a = 0; a < k; ++a) total *= n;
  Eigen::MatrixXd points(2 * k, total), bases = Eigen::MatrixXd::Zero(2 * k * k, total);
  for (int code = 0; code < total; ++code) {
    for (int a = 0, rest = code; a < k; ++a, rest /= n) {
      const double angle = 2 * std::numbers::pi * (rest % n) / n;
      points(2 * a, code) = std::cos(angle);
      points(2 * a + 1, code) = std::sin(angle);
      bases(2 * a * k + a, code) = -std::sin(angle);
      bases((2 * a + 1) * k + a, code) = std::cos(angle);
    }
  }
  sample.Append(points, bases);
  return sample;
}

// Random points of the first k coordinates' unit cube in R^d, all with that plane as tangent.
inline FramedPoints FlatSample(int k, int d, int count, std::uint64_t seed) {
  FramedPoints sample;
  sample.d = d;
  sample.k = k;
  Random random(seed, 98);
  Eigen::MatrixXd points = Eigen::MatrixXd::Zero(d, count);
  Eigen::MatrixXd bases = Eigen::MatrixXd::Zero(d * k, count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (int a = 0; a < k; ++a) {
      points(a, c) = random.Uniform();
      bases(a * k + a, c) = 1;
    }
  sample.Append(points, bases);
  return sample;
}

template <int K>
void AppendTo(Stars<K>* stars, const FramedPoints& sample) {
  for (std::uint32_t i = 0; i < sample.size(); ++i) stars->Add(sample.Point(i), sample.Tangent(i));
}

// All simplices without a fake facet that star(p) holds.
template <int K>
std::set<typename Stars<K>::Simplex> StarOf(const Stars<K>& stars, std::uint32_t p) {
  std::set<typename Stars<K>::Simplex> star;
  typename Stars<K>::Simplex simplex;
  for (std::size_t v = 0; v < stars.cell(p).vertex_count(); ++v)
    if (stars.SimplexOf(p, stars.cell(p), v, &simplex)) star.insert(simplex);
  return star;
}

template <int K>
std::set<typename Stars<K>::Simplex> AsSet(const std::vector<std::uint32_t>& flat) {
  std::set<typename Stars<K>::Simplex> simplices;
  for (std::size_t i = 0; i + K < flat.size(); i += K + 1) {
    typename Stars<K>::Simplex s;
    std::copy_n(flat.begin() + static_cast<std::ptrdiff_t>(i), K + 1, s.begin());
    simplices.insert(s);
  }
  return simplices;
}

}  // namespace stellate::core::testing
