#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "shapes/shapes.h"

namespace stellate::shapes {
namespace {

constexpr int kMaxSteps = 60;
constexpr int kGrid = 24;  // starting points are cut from rays over a kGrid x kGrid grid of angles
constexpr double kSlopeTarget = 1e-15, kSlopeAccepted = 1e-7;

double Value(const Eigen::Vector3d& y) {
  const Eigen::Array3d s = y.array().square();
  return (s.square() - 5 * s).sum() + 11.8;
}
Eigen::Vector3d Gradient(const Eigen::Vector3d& y) {
  return (4 * y.array().cube() - 10 * y.array()).matrix();
}
Eigen::Vector3d HessianDiagonal(const Eigen::Vector3d& y) {
  return (12 * y.array().square() - 10).matrix();
}

// Newton onto the surface along the gradient.
bool Correct(Eigen::Vector3d& y) {
  for (int i = 0; i < kMaxSteps; ++i) {
    const Eigen::Vector3d g = Gradient(y);
    const Eigen::Vector3d step = -Value(y) / g.squaredNorm() * g;
    const double length = step.norm();
    if (!(length < 1)) return false;
    y += step;
    if (length < 1e-15) return true;
  }
  return std::abs(Value(y)) < 1e-12;
}

Eigen::Matrix<double, 3, 2> TangentAt(const Eigen::Vector3d& y) {
  const Eigen::Vector3d n = Gradient(y).normalized();
  Eigen::Index smallest = 0;
  n.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix<double, 3, 2> tangent;
  tangent.col(0) = n.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  tangent.col(1) = n.cross(tangent.col(0));
  return tangent;
}

// From y on the surface to the nearest local minimum of the distance to x, by Newton's method on
// the surface with backtracking.
bool Descend(const Eigen::Vector3d& x, Eigen::Vector3d& y) {
  double slope = 1;
  for (int i = 0; i < kMaxSteps; ++i) {
    const Eigen::Matrix<double, 3, 2> tangent = TangentAt(y);
    const Eigen::Vector2d towards = tangent.transpose() * (x - y);
    slope = towards.norm();
    if (slope <= kSlopeTarget) return true;
    const Eigen::Vector3d g = Gradient(y);
    const double lambda = (x - y).dot(g) / g.squaredNorm();
    const Eigen::Matrix2d hessian =
        Eigen::Matrix2d::Identity() +
        lambda * tangent.transpose() * HessianDiagonal(y).asDiagonal() * tangent;
    // Rather along the gradient where the distance is not convex.
    const bool convex = hessian.trace() > 0 && hessian.determinant() > 1e-6;
    const Eigen::Vector2d step = convex ? Eigen::Vector2d(hessian.inverse() * towards) : towards;
    const double distance = (x - y).norm();
    double fraction = std::min(1.0, 0.5 / step.norm());
    Eigen::Vector3d next;
    for (; fraction > 1e-6; fraction /= 2) {
      next = y + fraction * (tangent * step);
      if (Correct(next) && (x - next).norm() < distance) break;
    }
    if (fraction > 1e-6) {
      y = next;
      continue;
    }
    // Rounding hides any decrease of the distance: a plain step still sharpens the position.
    next = y + tangent * step;
    if (slope < kSlopeAccepted && Correct(next)) y = next;
    break;
  }
  return slope <= kSlopeAccepted;
}

// The surface is symmetric under sign changes and permutations of the coordinates, so the closest
// point to x lies in x's own chamber: one chamber's worth of starting points serves them all.
class TanglecubeShape final : public PointwiseOracle {
 public:
  TanglecubeShape() : PointwiseOracle(2, 3) {
    for (int i = 0; i <= kGrid; ++i) {
      for (int j = 0; j <= i; ++j) {
        CutRay(Eigen::Vector3d(kGrid, i, j).normalized());
      }
    }
  }
  std::optional<BoundingBox> bounding_box() const override {
    return BoundingBox{Eigen::Vector3d::Constant(-2.5), Eigen::Vector3d::Constant(2.5)};
  }

  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    if (!x.allFinite()) return false;
    // Into the chamber x_0 >= x_1 >= x_2 >= 0, and back at the end.
    std::array<Eigen::Index, 3> order = {0, 1, 2};
    std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
      return std::abs(x[a]) > std::abs(x[b]) || (std::abs(x[a]) == std::abs(x[b]) && a < b);
    });
    const Eigen::Vector3d folded(std::abs(x[order[0]]), std::abs(x[order[1]]),
                                 std::abs(x[order[2]]));
    Eigen::Vector3d best;
    if (!Closest(folded, best)) return false;
    y.resize(3);
    for (int i = 0; i < 3; ++i) {
      const Eigen::Index axis = order[static_cast<size_t>(i)];
      y[axis] = std::copysign(best[i], x[axis]);
    }
    return true;
  }

  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    tangent = TangentAt(y);
  }

 private:
  // Keeps where the ray from the origin meets the surface: a quadratic in the squared distance.
  void CutRay(const Eigen::Vector3d& direction) {
    const double a = direction.array().square().square().sum(), b = -5, c = 11.8;
    const double discriminant = b * b - 4 * a * c;
    if (discriminant < 0) return;
    for (const double sign : {-1.0, 1.0}) {
      starts_.push_back(std::sqrt((-b + sign * std::sqrt(discriminant)) / (2 * a)) * direction);
    }
  }

  bool Closest(const Eigen::Vector3d& x, Eigen::Vector3d& best) const {
    // The nearest starting point of each of the two sheets that a ray meets, and x itself.
    Eigen::Vector3d candidates[3] = {starts_[0], starts_[1], x};
    for (size_t i = 0; i < starts_.size(); ++i) {
      Eigen::Vector3d& nearest = candidates[i % 2];
      if ((starts_[i] - x).squaredNorm() < (nearest - x).squaredNorm()) nearest = starts_[i];
    }
    bool found = false;
    for (Eigen::Vector3d& y : candidates) {
      // In the chamber of x; a walk that ends across a wall is folded back, never farther from x.
      if (!Correct(y) || !Descend(x, y)) continue;
      y = y.cwiseAbs();
      std::sort(y.data(), y.data() + 3, std::greater<double>());
      if (!found || (y - x).norm() < (best - x).norm()) best = y;
      found = true;
    }
    return found;
  }

  std::vector<Eigen::Vector3d> starts_;
};

}  // namespace

std::unique_ptr<PointwiseOracle> Tanglecube() { return std::make_unique<TanglecubeShape>(); }

}  // namespace stellate::shapes
