// Manifolds of matrices: SO(3), and the projective plane as rank-one projections.
#include <Eigen/Dense>
#include <cmath>

#include "shapes/shapes.h"

namespace stellate::shapes {
namespace {

using Matrix3R = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

class RotationsShape final : public PointwiseOracle {
 public:
  RotationsShape() : PointwiseOracle(3, 9) {}
  std::optional<BoundingBox> bounding_box() const override {
    return BoundingBox{Eigen::VectorXd::Constant(9, -1.1), Eigen::VectorXd::Constant(9, 1.1)};
  }
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    if (!x.allFinite()) return false;
    const Eigen::Matrix3d matrix = Eigen::Map<const Matrix3R>(x.data());
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d u = svd.matrixU();
    // The orthogonal Procrustes problem; a reflection gives way in the least singular direction.
    if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) = -u.col(2);
    y.resize(9);
    Eigen::Map<Matrix3R>(y.data()) = u * svd.matrixV().transpose();
    return true;
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    const Eigen::Matrix3d rotation = Eigen::Map<const Matrix3R>(y.data());
    tangent.resize(9, 3);
    for (int a = 0; a < 3; ++a) {
      Eigen::Matrix3d skew = Eigen::Matrix3d::Zero();
      skew((a + 1) % 3, (a + 2) % 3) = -std::sqrt(0.5);
      skew((a + 2) % 3, (a + 1) % 3) = std::sqrt(0.5);
      Matrix3R column = rotation * skew;
      tangent.col(a) = Eigen::Map<const Eigen::VectorXd>(column.data(), 9);
    }
  }
  // Any rotation is like any other: the reach.
  bool has_local_size() const override { return true; }
  double SizeAt(const Eigen::VectorXd& /*y*/) const override { return std::sqrt(2.0); }
};

// Symmetric matrices as R^6 with the Frobenius metric.
Vector6d ToVector(const Eigen::Matrix3d& s) {
  const double root2 = std::sqrt(2.0);
  Vector6d v;
  v << s(0, 0), s(1, 1), s(2, 2), root2 * s(0, 1), root2 * s(0, 2), root2 * s(1, 2);
  return v;
}
Eigen::Matrix3d ToMatrix(const Vector6d& v) {
  const double half = std::sqrt(0.5);
  Eigen::Matrix3d s;
  s << v[0], half * v[3], half * v[4], half * v[3], v[1], half * v[5], half * v[4], half * v[5],
      v[2];
  return s;
}
// Orthonormal coordinates of the trace-free matrices among all symmetric ones.
Eigen::Matrix<double, 5, 6> TraceFree() {
  const double a = std::sqrt(1.0 / 2), b = std::sqrt(1.0 / 6);
  Eigen::Matrix<double, 5, 6> t = Eigen::Matrix<double, 5, 6>::Zero();
  t.row(0).head<3>() << a, -a, 0;
  t.row(1).head<3>() << b, b, -2 * b;
  t.bottomRightCorner<3, 3>().setIdentity();
  return t;
}

class ProjectivePlaneShape final : public PointwiseOracle {
 public:
  explicit ProjectivePlaneShape(int d) : PointwiseOracle(2, d), trace_free_(TraceFree()) {}
  std::optional<BoundingBox> bounding_box() const override {
    const int d = ambient_dimension();
    return BoundingBox{Eigen::VectorXd::Constant(d, -1.1), Eigen::VectorXd::Constant(d, 1.1)};
  }
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    if (!x.allFinite()) return false;
    const Eigen::Vector3d v = Line(x);
    y = FromSymmetric(ToVector(v * v.transpose()));
    return true;
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    const Eigen::Vector3d v = Line(y);
    Eigen::MatrixXd across;
    ComplementOf(v, across);
    tangent.resize(ambient_dimension(), 2);
    for (int a = 0; a < 2; ++a) {
      const Eigen::Vector3d e = across.col(a);
      const Eigen::Matrix3d turn = std::sqrt(0.5) * (v * e.transpose() + e * v.transpose());
      // The turn is trace-free, so dropping the trace loses nothing of it.
      const Vector6d column = ToVector(turn);
      tangent.col(a) = ambient_dimension() == 6 ? Eigen::VectorXd(column)
                                                : Eigen::VectorXd(trace_free_ * column);
    }
  }
  // Any line is like any other: the reach.
  bool has_local_size() const override { return true; }
  double SizeAt(const Eigen::VectorXd& /*y*/) const override { return std::sqrt(0.5); }

 private:
  // The nearest v v^T has v the eigenvector of the largest eigenvalue; a multiple of the identity
  // added changes nothing, so the trace does not matter.
  Eigen::Vector3d Line(const Eigen::VectorXd& x) const {
    const Vector6d full =
        ambient_dimension() == 6 ? Vector6d(x) : Vector6d(trace_free_.transpose() * x);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(ToMatrix(full));
    return solver.eigenvectors().col(2);
  }
  Eigen::VectorXd FromSymmetric(const Vector6d& v) const {
    return ambient_dimension() == 6 ? Eigen::VectorXd(v) : Eigen::VectorXd(trace_free_ * v);
  }
  Eigen::Matrix<double, 5, 6> trace_free_;
};

}  // namespace

std::unique_ptr<PointwiseOracle> Rotations3() { return std::make_unique<RotationsShape>(); }
std::unique_ptr<PointwiseOracle> ProjectivePlane(int ambient_dimension) {
  return std::make_unique<ProjectivePlaneShape>(ambient_dimension);
}

}  // namespace stellate::shapes
