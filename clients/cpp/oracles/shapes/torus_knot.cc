#include <algorithm>
#include <cmath>
#include <numbers>

#include "shapes/length.h"
#include "shapes/shapes.h"

namespace stellate::shapes {
namespace {

constexpr int kSamplesPerTurn = 200;

// Closest points by a table of the whole curve: every dip of the sampled distance that can hold the
// minimum, given that the distance changes by no more than the arc between samples, is refined.
class TorusKnotShape final : public PointwiseOracle {
 public:
  TorusKnotShape(int p, int q) : PointwiseOracle(1, 3), p_(p), q_(q) {
    const int n = kSamplesPerTurn * std::max(std::abs(p), std::abs(q));
    step_ = 2 * std::numbers::pi / n;
    samples_.resize(3, n);
    for (int i = 0; i < n; ++i) samples_.col(i) = At(i * step_);
    slack_ = Length(3.0 * p, 1.0 * q) * step_;  // 3|p| and |q| bound the speed's two parts
  }
  std::optional<BoundingBox> bounding_box() const override {
    return BoundingBox{Eigen::Vector3d(-3.2, -3.2, -1.2), Eigen::Vector3d(3.2, 3.2, 1.2)};
  }

  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    if (!x.allFinite()) return false;
    const Eigen::Vector3d target = x;
    const Eigen::ArrayXd distance =
        (samples_.colwise() - target).colwise().squaredNorm().transpose().array().sqrt();
    const double limit = distance.minCoeff() + slack_;
    const Eigen::Index n = distance.size();
    double best = limit + 1;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double before = distance[(i + n - 1) % n], after = distance[(i + 1) % n];
      if (distance[i] > limit || distance[i] > before || distance[i] > after) continue;
      const Eigen::Vector3d candidate = At(Refine(target, static_cast<double>(i) * step_));
      const double length = (candidate - target).norm();
      if (length < best) {
        best = length;
        y = candidate;
      }
    }
    return true;
  }

  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    // y is on the curve: the nearest sample's parameter, refined, is its own.
    Eigen::Index nearest = 0;
    (samples_.colwise() - Eigen::Vector3d(y)).colwise().squaredNorm().minCoeff(&nearest);
    tangent = Velocity(Refine(y, static_cast<double>(nearest) * step_)).normalized();
  }

 private:
  Eigen::Vector3d At(double t) const {
    const double ring = 2 + std::cos(q_ * t);
    return {ring * std::cos(p_ * t), ring * std::sin(p_ * t), std::sin(q_ * t)};
  }
  Eigen::Vector3d Velocity(double t) const {
    const double ring = 2 + std::cos(q_ * t), change = -q_ * std::sin(q_ * t);
    const double c = std::cos(p_ * t), s = std::sin(p_ * t);
    return {change * c - ring * p_ * s, change * s + ring * p_ * c, q_ * std::cos(q_ * t)};
  }
  Eigen::Vector3d Acceleration(double t) const {
    const double ring = 2 + std::cos(q_ * t), change = -q_ * std::sin(q_ * t);
    const double bend = -q_ * q_ * std::cos(q_ * t);
    const double c = std::cos(p_ * t), s = std::sin(p_ * t);
    return {bend * c - 2 * change * p_ * s - ring * p_ * p_ * c,
            bend * s + 2 * change * p_ * c - ring * p_ * p_ * s, -q_ * q_ * std::sin(q_ * t)};
  }

  // The zero of the distance's derivative within a step of t0: Newton inside a shrinking bracket.
  double Refine(const Eigen::Vector3d& x, double t0) const {
    double low = t0 - step_, high = t0 + step_, t = t0;
    for (int i = 0; i < kMaxIterations && high > low; ++i) {
      const Eigen::Vector3d offset = At(t) - x, velocity = Velocity(t);
      const double slope = offset.dot(velocity);
      (slope > 0 ? high : low) = t;
      const double curvature = velocity.squaredNorm() + offset.dot(Acceleration(t));
      double next = t - slope / curvature;
      if (!(curvature > 0) || next < low || next > high) next = (low + high) / 2;
      if (std::abs(next - t) <= 1e-16 * (1 + std::abs(t))) return next;
      t = next;
    }
    return t;
  }

  int p_, q_;
  double step_ = 0, slack_ = 0;
  Eigen::Matrix3Xd samples_;
};

}  // namespace

std::unique_ptr<PointwiseOracle> TorusKnot(int p, int q) {
  return std::make_unique<TorusKnotShape>(p, q);
}

}  // namespace stellate::shapes
