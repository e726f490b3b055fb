#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>

#include "oracles/solids/motion.h"
#include "stellate/oracles/walls.h"

// The walls that solids are made of: functions that are positive inside, smooth where they are
// zero. Where it can be, a wall's value is the distance to it, so that walls can be offset and
// blended.
namespace stellate::solids {

class SolidWall;
using WallPtr = std::shared_ptr<const SolidWall>;

class SolidWall {
 public:
  virtual ~SolidWall() = default;
  virtual double Value(const Eigen::VectorXd& x) const = 0;
  virtual bool has_gradient() const = 0;
  virtual Eigen::VectorXd Gradient(const Eigen::VectorXd& x) const = 0;
  virtual WallPtr Moved(const Motion& motion) const = 0;
  // The wall that lies farther out by a distance; null where values are no distances, or nothing
  // would be left.
  virtual WallPtr Offset(double distance) const = 0;
  // 1 if both are the same wall, -1 if they are of opposite sides, 0 if they differ.
  virtual int Like(const SolidWall& other) const = 0;
};

// As oracles::Clipped takes it.
oracles::Wall AsFunctions(const WallPtr& wall);

// normal . x - level, with a unit normal inwards.
class Plane final : public SolidWall {
 public:
  Plane(const Eigen::VectorXd& normal, double level);
  const Eigen::VectorXd& normal() const { return normal_; }
  double level() const { return level_; }

  double Value(const Eigen::VectorXd& x) const override { return normal_.dot(x) - level_; }
  bool has_gradient() const override { return true; }
  Eigen::VectorXd Gradient(const Eigen::VectorXd& /*x*/) const override { return normal_; }
  WallPtr Moved(const Motion& motion) const override;
  WallPtr Offset(double distance) const override;
  int Like(const SolidWall& other) const override;

 private:
  Eigen::VectorXd normal_;
  double level_;
};

// A wall where it has not been moved to its place yet.
class Profile;
using ProfilePtr = std::shared_ptr<const Profile>;

class Profile {
 public:
  virtual ~Profile() = default;
  virtual double Value(const Eigen::VectorXd& x) const = 0;
  virtual bool has_gradient() const { return true; }
  virtual Eigen::VectorXd Gradient(const Eigen::VectorXd& x) const = 0;
  virtual ProfilePtr Offset(double /*distance*/) const { return nullptr; }
  virtual bool Equals(const Profile& other) const = 0;
  virtual std::optional<double> ball_radius() const { return std::nullopt; }  // about 0, of a ball
};

// What is within a radius of 0.
ProfilePtr Round(double radius);
// What is within a radius of the z axis.
ProfilePtr Tube(double radius);
// The side of a cone around the z axis: `radius` wide at z = 0, wider by `slope` a unit of z.
ProfilePtr Taper(double radius, double slope);
// What is within `minor` of a circle around the z axis.
ProfilePtr Ring(double major, double minor);
// What is within a radius of the z axis from -half to half.
ProfilePtr Pill(double half, double radius);
// A function of the user's. The profiles of one call, offset by the same, are equal.
ProfilePtr Given(std::function<double(const Eigen::VectorXd& x)> g,
                 std::function<Eigen::VectorXd(const Eigen::VectorXd& x)> gradient, bool distance);
// The union of two walls, its edge filled by a fillet: outside of both, where a and b are their
// values, the arc (r + a)^2 + (r + b)^2 = r^2.
ProfilePtr Blended(WallPtr first, WallPtr second, double radius);

// A profile somewhere in R^d: distances stay distances.
WallPtr Place(ProfilePtr profile, Motion motion);
// A wall whose other side is the inside.
WallPtr Opposite(WallPtr wall);

// A wall that is a sphere.
struct Sphere {
  Eigen::VectorXd centre;
  double radius;
};
std::optional<Sphere> SphereOf(const SolidWall& wall);

}  // namespace stellate::solids
