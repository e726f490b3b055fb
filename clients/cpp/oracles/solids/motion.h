#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

// Similarities of R^d, and convex bodies around solids, known by their support functions.
namespace stellate::solids {

// Of unit vectors, and of lengths beside their own size.
inline constexpr double kRounding = 1e-12;

// x -> scale * turn x + shift, with an orthogonal turn (d x d) and a scale above 0.
struct Motion {
  Eigen::MatrixXd turn;
  double scale = 1;
  Eigen::VectorXd shift;

  static Motion None(Eigen::Index d);
  Eigen::VectorXd Forth(const Eigen::VectorXd& x) const;
  Eigen::VectorXd Back(const Eigen::VectorXd& x) const;
  // `first`, and then this one.
  Motion After(const Motion& first) const;
  bool IsLike(const Motion& other) const;  // except for rounding
};

// A convex body.
class Body {
 public:
  virtual ~Body() = default;
  // The most that direction . x is in it; infinite where there is no most.
  virtual double Support(const Eigen::VectorXd& direction) const = 0;
  virtual std::shared_ptr<const Body> Moved(const Motion& motion) const = 0;
};
using BodyPtr = std::shared_ptr<const Body>;

// The convex hull of parallel discs, and what is within a distance of that.
struct Discs {
  Eigen::MatrixXd centres;    // d x m
  Eigen::VectorXd axis;       // a unit vector across them
  std::vector<double> radii;  // m
  double around = 0;          // the distance
  bool endless = false;       // it goes on along the axis, both ways
};
BodyPtr HullOf(Discs discs);
// The convex hull of several.
BodyPtr HullOf(std::vector<BodyPtr> bodies);
// A box.
BodyPtr HullOf(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper);
// All within a distance of a body; below 0, what has that much of it around.
BodyPtr Grown(BodyPtr body, double distance);

// A rotation of space that takes the z axis to a unit vector.
Eigen::Matrix3d TurnTo(const Eigen::Vector3d& axis);

}  // namespace stellate::solids
