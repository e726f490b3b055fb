#pragma once

#include <Eigen/Core>
#include <vector>

#include "stellate/oracle.h"

namespace stellate::oracles {

// The tensor product of cubic B-splines through values on a grid of a box, in any dimension.
// Mirrored at the border, beyond which it grows or falls with the distance.
class GridSpline {
 public:
  // As in SignedDistance::OfGrid. `outside`: 1 or -1, whether it grows or falls beyond the border,
  // as steeply as it changes anywhere; 0: neither. Throws std::invalid_argument.
  GridSpline(Eigen::VectorXd values, std::vector<int> shape, const BoundingBox& box,
             double outside);
  // What the constructor insists on.
  static void Check(const Eigen::VectorXd& values, const std::vector<int>& shape,
                    const BoundingBox& box);

  double Value(const Eigen::VectorXd& x) const;
  Eigen::VectorXd Gradient(const Eigen::VectorXd& x) const;
  double spacing() const { return spacing_.maxCoeff(); }  // the largest of all axes

 private:
  struct Place {
    Eigen::VectorXd inside, beyond;
  };
  // Where the four splines about a place are, and their weights there, along one axis.
  struct Along {
    std::ptrdiff_t at[4];
    double weight[4], slope[4];
  };
  Place Locate(const Eigen::VectorXd& x) const;
  std::vector<Along> Around(const Eigen::VectorXd& inside) const;
  double Sum(const std::vector<Along>& around, int derived) const;

  Eigen::VectorXd coefficients_, lower_, spacing_;
  std::vector<int> shape_;
  std::vector<std::ptrdiff_t> strides_;
  double steepness_ = 0;
};

}  // namespace stellate::oracles
