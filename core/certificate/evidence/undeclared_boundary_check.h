#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/batch.h"

namespace stellate::core {

// Where M ends. On a manifold without boundary whatever is asked about lies straight above its
// closest point y: q - y is normal to T_yM. Where it leans, M ends at y, or the tangent space there
// is poorly known. Steps from y the way it leans and the other way tell which: within M both go
// equally far, whatever the tangent space; at a rim the first comes back. They are half as long as
// the place, so that the first stays over the hole that q was over.

// Whether `along`, the part of q - y along the tangent space, is so much of |q - y|.
inline bool HasTangentialOffset(double along, double distance) { return along > 0.2 * distance; }

class UndeclaredBoundaryCheck {
 public:
  // `size`: the mesh's.
  explicit UndeclaredBoundaryCheck(double size) : size_(size) {}

  // A point y of M, the part of q - y along M's tangent space there, and |q - y|.
  void Add(const Eigen::VectorXd& y, const Eigen::VectorXd& along, double distance);

  // Closest points to ask for, d x n: about the 64 that place most since the last call, without
  // those that `position_error` of the answers explains.
  Eigen::MatrixXd Questions(double position_error);
  // The first place where M ends, in plain words, or nothing.
  std::string Judge(const AnswerBlock& answer, double position_error) const;

 private:
  struct Place {
    Eigen::VectorXd y, direction;  // unit
    double length = 0, share = 0;
  };
  double size_;
  std::vector<Place> places_, asked_;
};

}  // namespace stellate::core
