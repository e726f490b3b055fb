#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/refinement/candidate_set.h"
#include "core/status.h"

namespace stellate::core {

// Checks whether the answers about walls agree with those about M, by a few points of each wall:
// they must be on M and on the wall, and their conormals must point outward, turned by less than
// does harm. Of clearances only the signs are used.
class WallCheck {
 public:
  // epsilon: as the client gave it, length.
  WallCheck(int k, int d, double epsilon) : k_(k), d_(d), step_(kStep * epsilon) {}

  // Closest points on M^ to ask for, d x n: steps from the first points of each wall among
  // `answers` that lie beyond no other.
  Eigen::MatrixXd Questions(const AnsweredPoints& answers);
  // Of these: the first wall at fault, by name and place, or Ok.
  Status Judge(const AnsweredPoints& answers) const;

 private:
  // Of epsilon: the walls' curvature is not felt, and errors of positions much less.
  static constexpr double kStep = 0.01;

  // A point of a wall, and what was asked there: itself, a step out, and steps along the wall, as
  // its conormal has it, that turn inward a little.
  struct Sampled {
    int wall;
    Eigen::VectorXd point, conormal;
  };
  int steps() const { return 2 + (k_ == 1 ? 1 : 2 * (k_ - 1)); }

  int k_, d_;
  double step_;
  std::vector<Sampled> sampled_;
};

}  // namespace stellate::core
