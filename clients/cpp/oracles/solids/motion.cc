#include "oracles/solids/motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stellate::solids {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

class Hull final : public Body {
 public:
  explicit Hull(Discs discs) : discs_(std::move(discs)) {}

  double Support(const VectorXd& direction) const override {
    const double along = direction.dot(discs_.axis), length = direction.norm();
    if (discs_.endless && std::abs(along) > kRounding * length) {
      return std::numeric_limits<double>::infinity();
    }
    const double across = (direction - along * discs_.axis).norm();
    double most = -std::numeric_limits<double>::infinity();
    for (Index i = 0; i < discs_.centres.cols(); ++i) {
      most = std::max(most, direction.dot(discs_.centres.col(i)) +
                                across * discs_.radii[static_cast<size_t>(i)]);
    }
    return most + discs_.around * length;
  }

  BodyPtr Moved(const Motion& motion) const override {
    Discs moved = discs_;
    for (Index i = 0; i < moved.centres.cols(); ++i) {
      moved.centres.col(i) = motion.Forth(discs_.centres.col(i));
    }
    moved.axis = motion.turn * discs_.axis;
    for (double& radius : moved.radii) radius *= motion.scale;
    moved.around *= motion.scale;
    return std::make_shared<Hull>(std::move(moved));
  }

 private:
  Discs discs_;
};

class Hulls final : public Body {
 public:
  explicit Hulls(std::vector<BodyPtr> bodies) : bodies_(std::move(bodies)) {}

  double Support(const VectorXd& direction) const override {
    double most = -std::numeric_limits<double>::infinity();
    for (const BodyPtr& body : bodies_) most = std::max(most, body->Support(direction));
    return most;
  }

  BodyPtr Moved(const Motion& motion) const override {
    std::vector<BodyPtr> moved;
    moved.reserve(bodies_.size());
    for (const BodyPtr& body : bodies_) moved.push_back(body->Moved(motion));
    return std::make_shared<Hulls>(std::move(moved));
  }

 private:
  std::vector<BodyPtr> bodies_;
};

class TurnedBox final : public Body {
 public:
  TurnedBox(VectorXd centre, MatrixXd halves)
      : centre_(std::move(centre)), halves_(std::move(halves)) {}

  double Support(const VectorXd& direction) const override {
    return direction.dot(centre_) + (halves_.transpose() * direction).cwiseAbs().sum();
  }

  BodyPtr Moved(const Motion& motion) const override {
    return std::make_shared<TurnedBox>(motion.Forth(centre_), motion.scale * motion.turn * halves_);
  }

 private:
  VectorXd centre_;
  MatrixXd halves_;  // half a side in each column
};

class GrownBody final : public Body {
 public:
  GrownBody(BodyPtr body, double distance) : body_(std::move(body)), distance_(distance) {}

  double Support(const VectorXd& direction) const override {
    return body_->Support(direction) + distance_ * direction.norm();
  }

  BodyPtr Moved(const Motion& motion) const override {
    return std::make_shared<GrownBody>(body_->Moved(motion), motion.scale * distance_);
  }

 private:
  BodyPtr body_;
  double distance_;
};

}  // namespace

Motion Motion::None(Index d) { return {MatrixXd::Identity(d, d), 1, VectorXd::Zero(d)}; }

VectorXd Motion::Forth(const VectorXd& x) const { return scale * (turn * x) + shift; }

VectorXd Motion::Back(const VectorXd& x) const { return turn.transpose() * (x - shift) / scale; }

Motion Motion::After(const Motion& first) const {
  return {turn * first.turn, scale * first.scale, Forth(first.shift)};
}

bool Motion::IsLike(const Motion& other) const {
  if (shift.size() != other.shift.size()) return false;
  const double size = std::max(scale, shift.norm());
  return (turn - other.turn).cwiseAbs().maxCoeff() <= kRounding &&
         std::abs(scale - other.scale) <= kRounding * scale &&
         (shift - other.shift).cwiseAbs().maxCoeff() <= kRounding * size;
}

BodyPtr HullOf(Discs discs) { return std::make_shared<Hull>(std::move(discs)); }

BodyPtr HullOf(std::vector<BodyPtr> bodies) { return std::make_shared<Hulls>(std::move(bodies)); }

BodyPtr HullOf(const VectorXd& lower, const VectorXd& upper) {
  return std::make_shared<TurnedBox>((lower + upper) / 2, ((upper - lower) / 2).asDiagonal());
}

BodyPtr Grown(BodyPtr body, double distance) {
  return std::make_shared<GrownBody>(std::move(body), distance);
}

Eigen::Matrix3d TurnTo(const Eigen::Vector3d& axis) {
  const Eigen::Vector3d around = Eigen::Vector3d::UnitZ().cross(axis);
  const double sine = around.norm(), cosine = axis[2];
  if (sine < kRounding) {
    const double sign = cosine < 0 ? -1 : 1;
    return Eigen::Vector3d(1, sign, sign).asDiagonal();
  }
  const Eigen::Vector3d k = around / sine;
  Eigen::Matrix3d cross;
  cross << 0, -k[2], k[1], k[2], 0, -k[0], -k[1], k[0], 0;
  return Eigen::Matrix3d::Identity() + sine * cross + (1 - cosine) * cross * cross;
}

}  // namespace stellate::solids
