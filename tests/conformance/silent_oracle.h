#pragma once

#include <Eigen/Core>
#include <optional>
#include <stdexcept>

#include "stellate/oracle.h"

namespace stellate::testing {

// Of a manifold that nobody asks about.
class Silent final : public Oracle {
 public:
  Silent(int k, int d) : k_(k), d_(d) {}
  int dimension() const override { return k_; }
  int ambient_dimension() const override { return d_; }
  Answer ClosestPoint(const Eigen::MatrixXd&) override { throw std::logic_error("was asked"); }
  std::optional<BoundingBox> bounding_box() const override {
    return BoundingBox{-Eigen::VectorXd::Ones(d_), Eigen::VectorXd::Ones(d_)};
  }

 private:
  const int k_, d_;
};

}  // namespace stellate::testing
