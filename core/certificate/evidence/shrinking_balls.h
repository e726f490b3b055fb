#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// Bounds the reach from above by shrinking balls. A ball is tangent to M at a point p, with its
// centre on a normal n of M at p, and shrinks until M no longer enters it. If the point y of M
// nearest to the centre is inside, the ball through y, of radius |y - p|^2 / (2 n.(y - p)), is
// smaller and touches M at both p and y, so its radius bounds the reach. This finds both curvature
// and bottlenecks between sheets. All balls take their steps together. A ball is final once M
// enters it by no more than two hundredths of its radius. No QuerySource: its centres are one block
// of a Certifier's round, which also measures the oracle's error that its answers are judged by.
//
//   ShrinkingBalls balls(mesh, longest_edge);
//   balls.AddLargest(random_seed, count);
//   for (Eigen::MatrixXd c = balls.Centres(); c.cols() > 0; c = balls.Centres())
//     balls.Absorb(ClosestPoints(c), found, position_error);
class ShrinkingBalls {
 public:
  // `longest_edge`: by vertex, the sample's local scale. A ball is final, too, when an answer has
  // no meaning at that scale (IsTelling).
  ShrinkingBalls(const MeshView& mesh, const std::vector<double>& longest_edge)
      : mesh_(mesh), longest_edge_(longest_edge) {}

  // Adds balls at random vertices, on random normals, which begin as the largest that hold no other
  // vertex, and are no wider than the mesh: vertices are points of M, too, so that only what is
  // between or beside them is left to ask. A ball holds all smaller ones on its normal.
  void AddLargest(std::uint64_t random_seed, int count);
  // Adds two balls of one radius on either side of vertex v.
  void AddPair(std::uint32_t v, double radius, std::uint64_t random_seed);
  // Adds two balls at a point of M under a simplex, near its first vertex, where `tangents` (d x k)
  // nearly span the tangent space. How much the tangent spaces at the simplex's vertices differ
  // from them is taken off each bound, and answers that lie no steeper do not count.
  void AddPair(const std::uint32_t* simplex, const Eigen::VectorXd& point,
               const Eigen::MatrixXd& tangents, double radius, std::uint64_t random_key);

  // Returns the centres of the balls that may still shrink, d x n. Absorb takes their closest
  // points.
  Eigen::MatrixXd Centres() const;
  void Absorb(const Eigen::MatrixXd& nearest, const std::vector<std::uint8_t>& found,
              double position_error);

  // Answers other than the points that the balls touch, d each: points of M elsewhere.
  const std::vector<double>& met() const { return met_; }
  double reach() const { return reach_; }  // length; infinity while nothing was found
  std::uint32_t narrowest() const { return narrowest_; }  // the vertex where it was found
  double distance() const { return distance_; }  // from there to where the ball touches M again
  // The largest circumradius, estimated from a vertex's longest edge, over the ball's radius there.
  double coarseness() const { return coarseness_; }
  // The share of balls that end where this ratio is above kCoarse.
  double coarse_share() const {
    return added_ > 0 ? static_cast<double>(coarse_) / static_cast<double>(added_) : 0;
  }

 private:
  struct Ball {
    std::uint32_t vertex = 0;
    double radius = 0;       // length
    Eigen::VectorXd point;   // that it touches; empty: the vertex
    Eigen::VectorXd normal;  // unit
    double tilt = 0;         // sine of the angle that the normal may be wrong by
    bool is_coarse = false;
  };
  void AddBothSides(Ball ball, const Eigen::MatrixXd& tangents, std::uint64_t random_key);
  // How far a direction is from being normal at a vertex: the sine of the angle.
  double TiltAt(std::uint32_t v, const Eigen::VectorXd& normal) const;
  Eigen::VectorXd PointOf(const Ball& ball) const;
  void Add(Ball ball) {
    ++added_;
    active_.push_back(std::move(ball));
  }
  void ShrinkToVertices(Ball* ball);
  void Touch(Ball* ball, double radius, double across);
  bool AimAcross(const Eigen::MatrixXd& tangents, Random& random, Ball* ball) const;
  Eigen::MatrixXd TangentsOf(std::uint32_t v) const;

  const MeshView& mesh_;
  const std::vector<double>& longest_edge_;
  std::vector<Ball> active_;
  std::vector<double> met_;
  double reach_ = std::numeric_limits<double>::infinity();
  double distance_ = 0;
  std::uint32_t narrowest_ = 0;
  double coarseness_ = 0;
  std::uint64_t added_ = 0, coarse_ = 0;
};

}  // namespace stellate::core
