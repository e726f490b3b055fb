#pragma once

#include <functional>
#include <optional>
#include <utility>

#include "stellate/oracle.h"

namespace stellate::testing {

// A good oracle whose word can be changed before it is given. Empty hooks change nothing.
class SpoiledOracle final : public Oracle {
 public:
  explicit SpoiledOracle(Oracle& good)
      : intersects(good.has_intersect_flat()),
        has_tangents(good.has_tangent_basis()),
        has_sizes(good.has_local_size()),
        k(good.dimension()),
        d(good.ambient_dimension()),
        box(good.bounding_box()),
        given_seeds(good.seeds()),
        good_(good) {}

  // What it says of itself.
  bool intersects, has_tangents, has_sizes;
  int k, d;
  std::optional<BoundingBox> box;
  Eigen::MatrixXd given_seeds;

  // What it does to its answers.
  std::function<void(const Eigen::MatrixXd& x, Answer&)> on_closest;
  std::function<void(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                     const Eigen::VectorXd& radii, Answer&)>
      on_flat;
  std::function<void(Eigen::MatrixXd& tangents)> on_tangents;
  std::function<void(const Eigen::MatrixXd& points, Eigen::VectorXd& sizes)> on_sizes;

  int dimension() const override { return k; }
  int ambient_dimension() const override { return d; }
  bool has_intersect_flat() const override { return intersects; }
  bool has_tangent_basis() const override { return has_tangents; }
  bool has_local_size() const override { return has_sizes; }
  std::optional<BoundingBox> bounding_box() const override { return box; }
  Eigen::MatrixXd seeds() const override { return given_seeds; }

  Answer ClosestPoint(const Eigen::MatrixXd& x) override {
    Answer answer = good_.ClosestPoint(x);
    if (on_closest) on_closest(x, answer);
    return answer;
  }
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override {
    Answer answer = good_.IntersectFlat(centers, bases, radii);
    if (on_flat) on_flat(centers, bases, radii, answer);
    return answer;
  }
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    Eigen::MatrixXd tangents = good_.TangentBasis(points);
    if (on_tangents) on_tangents(tangents);
    return tangents;
  }
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override {
    Eigen::VectorXd sizes =
        good_.has_local_size() ? good_.LocalSize(points) : Eigen::VectorXd::Ones(points.cols());
    if (on_sizes) on_sizes(points, sizes);
    return sizes;
  }

 private:
  Oracle& good_;
};

}  // namespace stellate::testing
