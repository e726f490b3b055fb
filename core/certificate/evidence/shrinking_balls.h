#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "core/base/random.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// Estimates the reach from above by shrinking balls: a ball tangent to M at a point p of it, its
// centre on a normal of M at p, shrinks until M does not enter it any more. Whenever the centre's
// nearest point y is inside, the ball through y, of radius |y - p|^2 / (2 n.(y - p)), is smaller
// and still touches M at both p and y, so its radius bounds the reach. This finds both curvature
// and bottlenecks between sheets. All balls take their steps together. A ball that M does not enter
// by more than two hundredths of its radius is settled.
class ShrinkingBalls {
 public:
  // `longest_edge` by vertex: the sample's local scale; answers that tell nothing at that scale
  // (IsTelling) settle a ball.
  ShrinkingBalls(const MeshView& mesh, const std::vector<double>& longest_edge)
      : mesh_(mesh), longest_edge_(longest_edge) {}

  // At random vertices, on random normals. The first step asks for a ladder of radii, each half of
  // the one before, from half the mesh's width on: round trips cost more than questions, and one
  // more step then suffices.
  void AddLadders(std::uint64_t random_seed, int count);
  // Two balls of one radius on either side of vertex v.
  void AddPair(std::uint32_t v, double radius, std::uint64_t random_seed);
  // The same at a point of M under a simplex, near its first vertex, where `tangents` (d x k)
  // nearly span the tangent space: only what lies steeper above them than the tangent spaces of the
  // simplex's vertices differ from them counts, and for no more than that allows.
  void AddPair(const std::uint32_t* simplex, const Eigen::VectorXd& point,
               const Eigen::MatrixXd& tangents, double radius, std::uint64_t random_key);

  // Centres of the balls that may still shrink, d x n, and the answers to them.
  Eigen::MatrixXd Centres() const;
  void Absorb(const Eigen::MatrixXd& nearest, const std::vector<std::uint8_t>& found,
              double position_error);

  // Answers that were not the points that the balls touch, d each: points of M elsewhere.
  const std::vector<double>& met() const { return met_; }
  double reach() const { return reach_; }  // length; infinity while nothing was found
  std::uint32_t narrowest() const { return narrowest_; }  // the vertex where it was found
  double distance() const { return distance_; }  // from there to where the ball touches M again
  // The largest circumradius, told from a vertex's longest edge, over the ball's radius there.
  double coarseness() const { return coarseness_; }
  // Of all balls, those that settle where that is more than a mesh may be (kCoarse).
  double coarse_share() const {
    return added_ > 0 ? static_cast<double>(coarse_) / static_cast<double>(added_) : 0;
  }

 private:
  struct Ball {
    std::uint32_t vertex = 0;
    int rungs = 1;           // of the ladder that is asked for next
    double radius = 0;       // its first
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
