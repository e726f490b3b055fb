#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/refinement/candidate_set.h"
#include "core/status.h"

namespace stellate::core {

// Checks whether the answers about walls agree with those about M, by a few points of each wall:
// they must be on M and on the wall, and their conormals must point outward, with a harmless error.
// Only the signs of clearances are used. No QuerySource: its points are the candidates of one
// RoundTrip.
//
//   const Eigen::MatrixXd points = check.Questions(answers);  // then their closest points on M^:
//   Status status = check.Judge(answers to points);
class WallCheck {
 public:
  // epsilon: as the client gave it, length.
  WallCheck(int k, int d, double epsilon) : k_(k), d_(d), step_(kStep * epsilon) {}

  // Returns points whose closest points on M^ to query, d x n: steps from the first points of each
  // wall among `answers` that lie beyond no other wall.
  Eigen::MatrixXd Questions(const AnsweredPoints& answers);
  // Judges their answers. Returns the first wall that is wrong, with its number and the place, or
  // Ok.
  Status Judge(const AnsweredPoints& answers) const;

 private:
  // In epsilon: the walls' curvature has no effect at this length, and errors of positions even
  // less.
  static constexpr double kStep = 0.01;

  // A point of a wall. The queries there are the point itself, a step outward, and steps along the
  // wall, by its conormal, that turn inward a little.
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
