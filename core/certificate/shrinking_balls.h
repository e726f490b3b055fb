#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/certificate/certifier.h"

namespace stellate::core {

// Estimates the reach from above by shrinking balls: a ball tangent to M at a sample point p, its
// centre on a random normal of M at p, shrinks until M does not enter it any more. Whenever the
// centre's nearest point y is inside, the ball through y, of radius |y - p|^2 / (2 n.(y - p)), is
// smaller and still touches M at both p and y, so its radius bounds the reach. This finds both
// curvature and bottlenecks between sheets. All balls take their steps together, and the first step
// asks for a ladder of radii, each half of the one before: round trips are dearer than questions,
// and one more step then suffices. A ball that M does not enter by more than two hundredths of its
// radius is settled.
class ShrinkingBalls {
 public:
  // `longest_edge` by vertex: the sample's local scale, below which an answer says nothing.
  ShrinkingBalls(const MeshView& mesh, const std::vector<double>& longest_edge,
                 std::uint64_t random_seed, int count);

  bool settled() const { return active_.empty(); }
  // Centres of the balls that may still shrink, d x n, and the answers to them.
  Eigen::MatrixXd Centres() const;
  void Absorb(const Eigen::MatrixXd& nearest, const std::vector<std::uint8_t>& found);

  double reach() const { return reach_; }  // length; infinity while nothing was found
  std::uint32_t narrowest() const { return narrowest_; }  // the vertex where it was found
  // The largest circumradius, told from a vertex's longest edge, over the ball's radius there.
  double coarseness() const { return coarseness_; }

 private:
  struct Ball {
    std::uint32_t vertex = 0;
    Eigen::VectorXd normal;     // unit
    std::vector<double> radii;  // asked for next
    double scale = 0;           // answers nearer than this to the vertex settle the ball
  };

  const MeshView& mesh_;
  std::vector<Ball> active_;
  double reach_;
  std::uint32_t narrowest_ = 0;
  double coarseness_ = 0;
};

}  // namespace stellate::core
