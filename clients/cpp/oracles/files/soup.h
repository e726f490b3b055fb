#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "stellate/oracles/points.h"

namespace stellate::oracles::files {

// Points and polygons as they come from a file.
class Soup {
 public:
  // How messages name a polygon: "line" or "face", and a number.
  explicit Soup(std::string places) : places_(std::move(places)) {}

  void Reserve(size_t points) { points_.reserve(3 * points); }
  void AddPoint(double x, double y, double z) { points_.insert(points_.end(), {x, y, z}); }
  std::int64_t size() const { return std::ssize(points_) / 3; }

  // Corners are counted from 0. Split into triangles; fewer than three corners are an edge or less,
  // and left out. Refused where one is negative.
  void AddPolygon(const std::vector<std::int64_t>& corners, size_t place);

  Eigen::MatrixXd Points() const;  // 3 x n
  // Refused without triangles, or where one names a point that is not there.
  Triangles Finish() const;

 private:
  std::string places_;
  std::vector<double> points_;
  std::vector<int> corners_;
  std::int64_t largest_ = -1;
  size_t largest_place_ = 0;
};

}  // namespace stellate::oracles::files
