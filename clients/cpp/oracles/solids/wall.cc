#include "oracles/solids/wall.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace stellate::solids {
namespace {

using Eigen::Index, Eigen::VectorXd;

class Placed final : public SolidWall {
 public:
  Placed(ProfilePtr profile, Motion motion)
      : profile_(std::move(profile)), motion_(std::move(motion)) {}
  const Profile& profile() const { return *profile_; }
  const Motion& motion() const { return motion_; }

  double Value(const VectorXd& x) const override {
    return motion_.scale * profile_->Value(motion_.Back(x));
  }
  bool has_gradient() const override { return profile_->has_gradient(); }
  VectorXd Gradient(const VectorXd& x) const override {
    return motion_.turn * profile_->Gradient(motion_.Back(x));
  }
  WallPtr Moved(const Motion& motion) const override {
    return Place(profile_, motion.After(motion_));
  }
  WallPtr Offset(double distance) const override {
    ProfilePtr moved = profile_->Offset(distance / motion_.scale);
    return moved == nullptr ? nullptr : Place(std::move(moved), motion_);
  }
  int Like(const SolidWall& other) const override {
    const auto* const placed = dynamic_cast<const Placed*>(&other);
    return placed != nullptr && profile_->Equals(*placed->profile_) &&
                   motion_.IsLike(placed->motion_)
               ? 1
               : 0;
  }

 private:
  ProfilePtr profile_;
  Motion motion_;
};

class Turned final : public SolidWall {
 public:
  explicit Turned(WallPtr wall) : wall_(std::move(wall)) {}

  double Value(const VectorXd& x) const override { return -wall_->Value(x); }
  bool has_gradient() const override { return wall_->has_gradient(); }
  VectorXd Gradient(const VectorXd& x) const override { return -wall_->Gradient(x); }
  WallPtr Moved(const Motion& motion) const override { return Opposite(wall_->Moved(motion)); }
  WallPtr Offset(double distance) const override {
    WallPtr moved = wall_->Offset(-distance);
    return moved == nullptr ? nullptr : Opposite(std::move(moved));
  }
  int Like(const SolidWall& other) const override {
    if (const auto* const turned = dynamic_cast<const Turned*>(&other)) {
      return wall_->Like(*turned->wall_);
    }
    return -wall_->Like(other);
  }

 private:
  WallPtr wall_;
};

VectorXd UnitOf(const VectorXd& v) {
  const double length = v.norm();
  return v / (length > 0 ? length : 1);
}

// Profiles that are known by some numbers.
template <typename Self>
class ByNumbers : public Profile {
 public:
  bool Equals(const Profile& other) const override {
    const auto* const same = dynamic_cast<const Self*>(&other);
    return same != nullptr && static_cast<const Self&>(*this).key() == same->key();
  }
};

class RoundProfile final : public ByNumbers<RoundProfile> {
 public:
  explicit RoundProfile(double radius) : radius_(radius) {}
  double key() const { return radius_; }
  double Value(const VectorXd& x) const override { return radius_ - x.norm(); }
  VectorXd Gradient(const VectorXd& x) const override { return -UnitOf(x); }
  ProfilePtr Offset(double by) const override {
    return radius_ + by > 0 ? Round(radius_ + by) : nullptr;
  }
  std::optional<double> ball_radius() const override { return radius_; }

 private:
  double radius_;
};

class TubeProfile final : public ByNumbers<TubeProfile> {
 public:
  explicit TubeProfile(double radius) : radius_(radius) {}
  double key() const { return radius_; }
  double Value(const VectorXd& x) const override { return radius_ - x.head(2).norm(); }
  VectorXd Gradient(const VectorXd& x) const override {
    VectorXd slope = VectorXd::Zero(x.size());
    slope.head(2) = -UnitOf(x.head(2));
    return slope;
  }
  ProfilePtr Offset(double by) const override {
    return radius_ + by > 0 ? Tube(radius_ + by) : nullptr;
  }

 private:
  double radius_;
};

class TaperProfile final : public ByNumbers<TaperProfile> {
 public:
  TaperProfile(double radius, double slope) : radius_(radius), slope_(slope) {}
  std::pair<double, double> key() const { return {radius_, slope_}; }
  double Value(const VectorXd& x) const override {
    return (radius_ + slope_ * x[2] - x.head(2).norm()) / steep();
  }
  VectorXd Gradient(const VectorXd& x) const override {
    VectorXd slope(3);
    slope << -UnitOf(x.head(2)), slope_;
    return slope / steep();
  }
  ProfilePtr Offset(double by) const override { return Taper(radius_ + by * steep(), slope_); }

 private:
  double steep() const { return std::sqrt(1 + slope_ * slope_); }

  double radius_, slope_;
};

class RingProfile final : public ByNumbers<RingProfile> {
 public:
  RingProfile(double major, double minor) : major_(major), minor_(minor) {}
  std::pair<double, double> key() const { return {major_, minor_}; }
  double Value(const VectorXd& x) const override { return minor_ - FromCircle(x).norm(); }
  VectorXd Gradient(const VectorXd& x) const override {
    const VectorXd away = UnitOf(FromCircle(x));
    VectorXd slope(3);
    slope << -away[0] * UnitOf(x.head(2)), -away[1];
    return slope;
  }
  ProfilePtr Offset(double by) const override {
    const double minor = minor_ + by;
    return 0 < minor && minor < major_ ? Ring(major_, minor) : nullptr;
  }

 private:
  VectorXd FromCircle(const VectorXd& x) const {
    return Eigen::Vector2d(x.head(2).norm() - major_, x[2]);
  }

  double major_, minor_;
};

class PillProfile final : public ByNumbers<PillProfile> {
 public:
  PillProfile(double half, double radius) : half_(half), radius_(radius) {}
  std::pair<double, double> key() const { return {half_, radius_}; }
  double Value(const VectorXd& x) const override { return radius_ - FromSegment(x).norm(); }
  VectorXd Gradient(const VectorXd& x) const override { return -UnitOf(FromSegment(x)); }
  ProfilePtr Offset(double by) const override {
    return radius_ + by > 0 ? Pill(half_, radius_ + by) : nullptr;
  }

 private:
  VectorXd FromSegment(const VectorXd& x) const {
    VectorXd away = x;
    away[2] -= std::clamp(x[2], -half_, half_);
    return away;
  }

  double half_, radius_;
};

struct Functions {
  std::function<double(const VectorXd& x)> g;
  std::function<VectorXd(const VectorXd& x)> gradient;
  bool distance;
};

class GivenProfile final : public ByNumbers<GivenProfile> {
 public:
  GivenProfile(std::shared_ptr<const Functions> functions, double added)
      : functions_(std::move(functions)), added_(added) {}
  std::pair<const Functions*, double> key() const { return {functions_.get(), added_}; }
  double Value(const VectorXd& x) const override { return functions_->g(x) + added_; }
  bool has_gradient() const override { return static_cast<bool>(functions_->gradient); }
  VectorXd Gradient(const VectorXd& x) const override {
    VectorXd slope = functions_->gradient(x);
    if (slope.size() == x.size()) return slope;
    throw OracleError("ORACLE_SHAPE", "a gradient in R^" + std::to_string(x.size()) + " has " +
                                          std::to_string(slope.size()) +
                                          " numbers: it takes as many as a point");
  }
  ProfilePtr Offset(double by) const override {
    if (!functions_->distance) return nullptr;
    return std::make_shared<GivenProfile>(functions_, added_ + by);
  }

 private:
  std::shared_ptr<const Functions> functions_;
  double added_;
};

class BlendedProfile final : public ByNumbers<BlendedProfile> {
 public:
  BlendedProfile(WallPtr first, WallPtr second, double radius)
      : first_(std::move(first)), second_(std::move(second)), radius_(radius) {}
  std::pair<std::pair<const SolidWall*, const SolidWall*>, double> key() const {
    return {{first_.get(), second_.get()}, radius_};
  }
  double Value(const VectorXd& x) const override {
    const double a = first_->Value(x), b = second_->Value(x);
    return std::min(-radius_, std::max(a, b)) + Arc(a, b).norm();
  }
  bool has_gradient() const override { return first_->has_gradient() && second_->has_gradient(); }
  VectorXd Gradient(const VectorXd& x) const override {
    const double a = first_->Value(x), b = second_->Value(x);
    Eigen::Vector2d share = Arc(a, b);
    const double arc = share.norm();
    if (arc > 0) {
      share /= arc;
    } else {  // far from both: as the nearer of them is
      share = a >= b ? Eigen::Vector2d::UnitX() : Eigen::Vector2d::UnitY();
    }
    return share[0] * first_->Gradient(x) + share[1] * second_->Gradient(x);
  }

 private:
  Eigen::Vector2d Arc(double a, double b) const {
    return Eigen::Vector2d(radius_ + a, radius_ + b).cwiseMax(0);
  }

  WallPtr first_, second_;
  double radius_;
};

}  // namespace

Plane::Plane(const VectorXd& normal, double level)
    : normal_(normal / normal.norm()), level_(level / normal.norm()) {
  normal_.array() += 0.0;  // without -0
  level_ += 0.0;
}

WallPtr Plane::Moved(const Motion& motion) const {
  const VectorXd normal = motion.turn * normal_;
  return std::make_shared<Plane>(normal, motion.scale * level_ + normal.dot(motion.shift));
}

WallPtr Plane::Offset(double distance) const {
  return std::make_shared<Plane>(normal_, level_ - distance);
}

int Plane::Like(const SolidWall& other) const {
  const auto* const plane = dynamic_cast<const Plane*>(&other);
  if (plane == nullptr) return 0;
  const double size = kRounding * std::max(1.0, std::abs(level_));
  for (const int sign : {1, -1}) {
    if ((normal_ - sign * plane->normal_).cwiseAbs().maxCoeff() <= kRounding &&
        std::abs(level_ - sign * plane->level_) <= size) {
      return sign;
    }
  }
  return 0;
}

oracles::Wall AsFunctions(const WallPtr& wall) {
  oracles::Wall functions{[wall](const VectorXd& x) { return wall->Value(x); }};
  if (wall->has_gradient()) {
    functions.gradient = [wall](const VectorXd& x) { return wall->Gradient(x); };
  }
  return functions;
}

ProfilePtr Round(double radius) { return std::make_shared<RoundProfile>(radius); }
ProfilePtr Tube(double radius) { return std::make_shared<TubeProfile>(radius); }
ProfilePtr Taper(double radius, double slope) {
  return std::make_shared<TaperProfile>(radius, slope);
}
ProfilePtr Ring(double major, double minor) { return std::make_shared<RingProfile>(major, minor); }
ProfilePtr Pill(double half, double radius) { return std::make_shared<PillProfile>(half, radius); }

ProfilePtr Given(std::function<double(const VectorXd& x)> g,
                 std::function<VectorXd(const VectorXd& x)> gradient, bool distance) {
  auto functions =
      std::make_shared<const Functions>(Functions{std::move(g), std::move(gradient), distance});
  return std::make_shared<GivenProfile>(std::move(functions), 0.0);
}

ProfilePtr Blended(WallPtr first, WallPtr second, double radius) {
  return std::make_shared<BlendedProfile>(std::move(first), std::move(second), radius);
}

WallPtr Place(ProfilePtr profile, Motion motion) {
  return std::make_shared<Placed>(std::move(profile), std::move(motion));
}

WallPtr Opposite(WallPtr wall) { return std::make_shared<Turned>(std::move(wall)); }

std::optional<Sphere> SphereOf(const SolidWall& wall) {
  const auto* const placed = dynamic_cast<const Placed*>(&wall);
  if (placed == nullptr) return std::nullopt;
  const std::optional<double> radius = placed->profile().ball_radius();
  if (!radius) return std::nullopt;
  return Sphere{placed->motion().shift, placed->motion().scale * *radius};
}

}  // namespace stellate::solids
