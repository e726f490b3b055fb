#include <algorithm>
#include <cmath>

#include "shapes/length.h"
#include "shapes/shapes.h"

namespace stellate::shapes {
namespace {

class TorusShape final : public PointwiseOracle {
 public:
  TorusShape(double R, double r) : PointwiseOracle(2, 3), R_(R), r_(r) {}
  std::optional<BoundingBox> bounding_box() const override {
    const Eigen::Vector3d half(1.05 * (R_ + r_), 1.05 * (R_ + r_), 1.1 * r_);
    return BoundingBox{-half, half};
  }
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    if (!x.allFinite()) return false;
    const Eigen::Vector3d around = Around(x);
    // In the half plane through x: the tube's centre is (R, 0).
    const double u = Length(x[0], x[1]) - R_;
    const double norm = Length(u, x[2]);
    const double outward = norm > 0 ? u / norm : 1, up = norm > 0 ? x[2] / norm : 0;
    y = (R_ + r_ * outward) * around + r_ * up * Eigen::Vector3d::UnitZ();
    return true;
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    const Eigen::Vector3d around = Around(y);
    const Eigen::Vector2d normal = Eigen::Vector2d(Length(y[0], y[1]) - R_, y[2]).normalized();
    tangent.resize(3, 2);
    tangent.col(0) << -around[1], around[0], 0;
    tangent.col(1) = -normal[1] * around + normal[0] * Eigen::Vector3d::UnitZ();
  }
  // The medial axis is the circle inside the tube, and the axis of revolution.
  bool has_local_size() const override { return true; }
  double SizeAt(const Eigen::VectorXd& y) const override {
    return std::min(r_, Length(y[0], y[1]));
  }

 private:
  // The unit horizontal vector from the axis to x.
  static Eigen::Vector3d Around(const Eigen::VectorXd& x) {
    const double rho = Length(x[0], x[1]);
    return rho > 0 ? Eigen::Vector3d(x[0] / rho, x[1] / rho, 0) : Eigen::Vector3d::UnitX();
  }
  double R_, r_;
};

}  // namespace

std::unique_ptr<PointwiseOracle> Torus(double R, double r) {
  return std::make_unique<TorusShape>(R, r);
}

}  // namespace stellate::shapes
