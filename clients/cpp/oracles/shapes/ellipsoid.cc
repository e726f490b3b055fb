#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "shapes/shapes.h"

namespace stellate::shapes {
namespace {

// The closest point to x is y_i = a_i^2 x_i / (a_i^2 + t), with t the largest root of
// g(t) = sum (a_i x_i / (a_i^2 + t))^2 - 1. Right of the pole at -min a_i^2, g is convex and falls,
// so Newton's method from a point with g >= 0 climbs to the root without overshooting.
class EllipsoidShape final : public PointwiseOracle {
 public:
  explicit EllipsoidShape(const std::vector<double>& axes)
      : PointwiseOracle(static_cast<int>(axes.size()) - 1, static_cast<int>(axes.size())),
        axes_(
            Eigen::Map<const Eigen::ArrayXd>(axes.data(), static_cast<Eigen::Index>(axes.size()))) {
    axes_.minCoeff(&shortest_);
    medial_ = (axes_.square() - axes_[shortest_] * axes_[shortest_]) / axes_;
  }
  std::optional<BoundingBox> bounding_box() const override {
    return BoundingBox{-1.1 * axes_.matrix(), 1.1 * axes_.matrix()};
  }

  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    if (!x.allFinite()) return false;
    const Eigen::ArrayXd squares = axes_.square();
    const Eigen::ArrayXd ax = axes_ * x.array().abs();
    const double pole = -squares[shortest_];
    // Where one term alone is 1 the sum is at least 1.
    double t = std::max((ax - squares).maxCoeff(), pole);
    if (t <= pole) {
      // x has no component along the shortest axes. Near the centre the closest point leaves that
      // subspace: two choices by symmetry, and t sits on the pole.
      y = (squares > -pole).select(squares * x.array() / (squares + pole).max(kTiny), 0.0);
      const double rest = 1 - (y.array() / axes_).square().sum();
      if (rest >= 0) {
        y[shortest_] = axes_[shortest_] * std::sqrt(rest);
        return true;
      }
      t = pole + kTiny;
    }
    for (int i = 0; i < kMaxIterations; ++i) {
      const Eigen::ArrayXd terms = (ax / (squares + t)).square();
      const double step = (terms.sum() - 1) / (2 * (terms / (squares + t)).sum());
      const double next = t + step;
      if (!(next > t)) {
        // Rounding: a last step to the left is as good as any, but never across the pole.
        if (next > pole) t = next;
        break;
      }
      t = next;
    }
    y = squares * x.array() / (squares + t);
    // One Newton step along the normal takes off what rounding in t left of F(y) = 0.
    const Eigen::ArrayXd gradient = y.array() / squares;
    const double value = (y.array() / axes_).square().sum() - 1;
    y.array() -= value / (2 * gradient.square().sum()) * gradient;
    return y.allFinite();
  }

  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    ComplementOf((y.array() / axes_.square()).matrix().normalized(), tangent);
  }
  // Inner normals meet where the shortest coordinates vanish: the medial axis is the solid
  // ellipsoid there of semi-axes b_i = (a_i^2 - min a^2) / a_i. Its nearest point, from outside, is
  // found as Project's is.
  bool has_local_size() const override { return true; }
  double SizeAt(const Eigen::VectorXd& y) const override {
    const auto wide = medial_ > 0;
    const Eigen::ArrayXd squares = medial_.square();
    const Eigen::ArrayXd by = wide.select(medial_ * y.array().abs(), 0.0);
    double t = 0;
    for (int i = 0; i < kMaxIterations; ++i) {
      const Eigen::ArrayXd below = (squares + t).max(kTiny);
      const Eigen::ArrayXd terms = (by / below).square();
      const double excess = terms.sum() - 1;
      if (!(excess > 0)) break;  // inside, or arrived
      const double next = t + excess / (2 * (terms / below).sum());
      if (!(next > t)) break;
      t = next;
    }
    const Eigen::ArrayXd off = wide.select(t / (squares + t).max(kTiny), 1.0);
    return (off * y.array()).matrix().norm();
  }

 private:
  static constexpr double kTiny = std::numeric_limits<double>::min();
  Eigen::ArrayXd axes_;
  Eigen::ArrayXd medial_;  // b
  Eigen::Index shortest_ = 0;
};

}  // namespace

std::unique_ptr<PointwiseOracle> Ellipsoid(const std::vector<double>& axes) {
  return std::make_unique<EllipsoidShape>(axes);
}

}  // namespace stellate::shapes
