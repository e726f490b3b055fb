// Spheres and products of circles: everything in closed form.
#include <algorithm>
#include <cmath>
#include <utility>

#include "shapes/length.h"
#include "shapes/shapes.h"

namespace stellate::shapes {

void ComplementOf(const Eigen::VectorXd& n, Eigen::MatrixXd& tangent) {
  // The Householder reflection that takes n to -+e_j takes the other axes to a basis of n's
  // complement; the largest coordinate j keeps it well conditioned.
  const Eigen::Index m = n.size();
  Eigen::Index j = 0;
  n.cwiseAbs().maxCoeff(&j);
  Eigen::VectorXd v = n;
  v[j] += n[j] >= 0 ? 1 : -1;
  const double scale = 2 / v.squaredNorm();
  tangent.resize(m, m - 1);
  for (Eigen::Index i = 0, column = 0; i < m; ++i) {
    if (i == j) continue;
    tangent.col(column) = -scale * v[i] * v;
    tangent(i, column) += 1;
    ++column;
  }
}

namespace {

BoundingBox CubeOf(int d, double half) {
  return {Eigen::VectorXd::Constant(d, -half), Eigen::VectorXd::Constant(d, half)};
}

class SphereShape final : public PointwiseOracle {
 public:
  explicit SphereShape(int k) : PointwiseOracle(k, k + 1) {}
  std::optional<BoundingBox> bounding_box() const override {
    return CubeOf(ambient_dimension(), 1.1);
  }
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    const double norm = x.stableNorm();
    if (norm > 0) {
      y = x / norm;
    } else {
      y = Eigen::VectorXd::Unit(ambient_dimension(), 0);  // every point is nearest to the centre
    }
    return std::isfinite(norm);
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    ComplementOf(y.normalized(), tangent);
  }
  bool has_local_size() const override { return true; }
  double SizeAt(const Eigen::VectorXd& /*y*/) const override { return 1; }
};

class TwoSpheresShape final : public PointwiseOracle {
 public:
  TwoSpheresShape() : PointwiseOracle(2, 3) {}
  std::optional<BoundingBox> bounding_box() const override {
    return BoundingBox{Eigen::Vector3d(-2.7, -1.2, -1.2), Eigen::Vector3d(2.7, 1.2, 1.2)};
  }
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    // Equal spheres: the nearer centre has the nearer sphere.
    const Eigen::Vector3d center = Center(x);
    const Eigen::Vector3d from = x - center;
    const double norm = from.norm();
    y = norm > 0 ? Eigen::Vector3d(center + from / norm)
                 : Eigen::Vector3d(center + Eigen::Vector3d::UnitZ());
    return std::isfinite(norm);
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    ComplementOf((y - Center(y)).normalized(), tangent);
  }
  // The medial axis is the two centres, and the plane between.
  bool has_local_size() const override { return true; }
  double SizeAt(const Eigen::VectorXd& y) const override { return std::min(1.0, std::abs(y[0])); }

 private:
  static Eigen::Vector3d Center(const Eigen::VectorXd& x) { return {x[0] < 0 ? -1.5 : 1.5, 0, 0}; }
};

class CirclesShape final : public PointwiseOracle {
 public:
  explicit CirclesShape(std::vector<double> radii)
      : PointwiseOracle(static_cast<int>(radii.size()), 2 * static_cast<int>(radii.size())),
        radii_(std::move(radii)) {}
  std::optional<BoundingBox> bounding_box() const override {
    Eigen::VectorXd half(ambient_dimension());
    for (int i = 0; i < dimension(); ++i)
      half.segment(2 * i, 2).setConstant(1.1 * radii_[Index(i)]);
    return BoundingBox{-half, half};
  }
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    y.resize(ambient_dimension());
    for (int i = 0; i < dimension(); ++i) {
      const double norm = Length(x[2 * i], x[2 * i + 1]);
      if (!std::isfinite(norm)) return false;
      const double r = radii_[Index(i)];
      y[2 * i] = norm > 0 ? r * (x[2 * i] / norm) : r;
      y[2 * i + 1] = norm > 0 ? r * (x[2 * i + 1] / norm) : 0;
    }
    return true;
  }
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    tangent.setZero(ambient_dimension(), dimension());
    for (int i = 0; i < dimension(); ++i) {
      const double norm = Length(y[2 * i], y[2 * i + 1]);
      tangent(2 * i, i) = -y[2 * i + 1] / norm;
      tangent(2 * i + 1, i) = y[2 * i] / norm;
    }
  }
  // Where some circle is at its centre.
  bool has_local_size() const override { return true; }
  double SizeAt(const Eigen::VectorXd& /*y*/) const override {
    return *std::min_element(radii_.begin(), radii_.end());
  }

 private:
  static size_t Index(int i) { return static_cast<size_t>(i); }
  std::vector<double> radii_;
};

}  // namespace

std::unique_ptr<PointwiseOracle> Sphere(int k) { return std::make_unique<SphereShape>(k); }
std::unique_ptr<PointwiseOracle> TwoSpheres() { return std::make_unique<TwoSpheresShape>(); }
std::unique_ptr<PointwiseOracle> Circles(std::vector<double> radii) {
  return std::make_unique<CirclesShape>(std::move(radii));
}

}  // namespace stellate::shapes
