#include "tests/truth/shapes.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stellate::truth {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// An orthonormal basis of what is orthogonal to n.
MatrixXd Across(const VectorXd& n) {
  const MatrixXd q = Eigen::HouseholderQR<MatrixXd>(MatrixXd(n)).householderQ() *
                     MatrixXd::Identity(n.size(), n.size());
  return q.rightCols(n.size() - 1);
}

VectorXd UnitOr(const VectorXd& v, double* length) {
  *length = v.norm();
  return *length > 0 ? VectorXd(v / *length) : VectorXd(VectorXd::Unit(v.size(), 0));
}

class CurvesShape final : public Shape {
 public:
  explicit CurvesShape(std::vector<Curve> curves)
      : curves_(std::move(curves)), reach_(ReachOf(curves_)) {}
  int k() const override { return 1; }
  int d() const override { return curves_[0].d(); }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    double t = 0;
    const Curve* curve = NearestOf(curves_, x, &t);
    if (tangent) *tangent = curve->Tangent(t);
    return curve->At(t);
  }
  std::vector<int> Betti() const override {
    const int n = static_cast<int>(curves_.size());
    return {n, n};
  }
  double Reach() const override { return reach_; }
  MatrixXd Seeds() const override {
    MatrixXd seeds(d(), static_cast<Eigen::Index>(curves_.size()));
    for (std::size_t i = 0; i < curves_.size(); ++i)
      seeds.col(static_cast<Eigen::Index>(i)) = curves_[i].At(1);
    return seeds;
  }
  double Radius() const override { return RadiusOf(curves_); }
  int Component(const VectorXd& y) const override {
    double t = 0;
    return static_cast<int>(NearestOf(curves_, y, &t) - curves_.data());
  }
  const std::vector<Curve>* curves() const override { return &curves_; }

 private:
  std::vector<Curve> curves_;
  double reach_;
};

class RevolutionShape final : public Shape {
 public:
  RevolutionShape(std::vector<Curve> profiles, bool symmetric, int m)
      : profiles_(std::move(profiles)), symmetric_(symmetric), m_(m) {
    std::vector<Curve> section = profiles_;
    if (!symmetric)
      for (const Curve& c : profiles_) section.push_back(c.Mirrored());
    reach_ = ReachOf(section);
  }
  int k() const override { return m_ + 1; }
  int d() const override { return m_ + 2; }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    double rho = 0;
    const VectorXd out = UnitOr(x.head(m_ + 1), &rho);
    double t = 0;
    const Curve* curve = NearestOf(profiles_, Eigen::Vector2d(rho, x[m_ + 1]), &t);
    const VectorXd at = curve->At(t);
    VectorXd y(d());
    y << at[0] * out, at[1];
    if (tangent) {
      const VectorXd along = curve->Tangent(t);
      *tangent = MatrixXd::Zero(d(), k());
      tangent->topRightCorner(m_ + 1, m_) = Across(out);
      tangent->col(0).head(m_ + 1) = along[0] * out;
      (*tangent)(m_ + 1, 0) = along[1];
    }
    return y;
  }
  std::vector<int> Betti() const override {
    const int n = static_cast<int>(profiles_.size());
    std::vector<int> betti(static_cast<std::size_t>(k()) + 1, 0);
    betti.front() += n;
    betti.back() += n;
    if (!symmetric_) {
      betti[1] += n;
      betti[static_cast<std::size_t>(m_)] += n;
    }
    return betti;
  }
  double Reach() const override { return reach_; }
  MatrixXd Seeds() const override {
    MatrixXd seeds = MatrixXd::Zero(d(), static_cast<Eigen::Index>(profiles_.size()));
    for (std::size_t i = 0; i < profiles_.size(); ++i) {
      const VectorXd at = profiles_[i].At(1);
      seeds(0, static_cast<Eigen::Index>(i)) = at[0];
      seeds(d() - 1, static_cast<Eigen::Index>(i)) = at[1];
    }
    return seeds;
  }
  double Radius() const override { return RadiusOf(profiles_); }
  int Component(const VectorXd& y) const override {
    double t = 0;
    const Eigen::Vector2d at(y.head(m_ + 1).norm(), y[m_ + 1]);
    return static_cast<int>(NearestOf(profiles_, at, &t) - profiles_.data());
  }

 private:
  std::vector<Curve> profiles_;
  bool symmetric_;
  int m_;
  double reach_ = 0;
};

class ProductShape final : public Shape {
 public:
  ProductShape(ShapePtr a, ShapePtr b) : a_(std::move(a)), b_(std::move(b)) {}
  int k() const override { return a_->k() + b_->k(); }
  int d() const override { return a_->d() + b_->d(); }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    MatrixXd ta, tb;
    VectorXd y(d());
    y << a_->Closest(x.head(a_->d()), tangent ? &ta : nullptr),
        b_->Closest(x.tail(b_->d()), tangent ? &tb : nullptr);
    if (tangent) {
      *tangent = MatrixXd::Zero(d(), k());
      tangent->topLeftCorner(a_->d(), a_->k()) = ta;
      tangent->bottomRightCorner(b_->d(), b_->k()) = tb;
    }
    return y;
  }
  std::vector<int> Betti() const override {
    const std::vector<int> a = a_->Betti(), b = b_->Betti();
    std::vector<int> betti(a.size() + b.size() - 1, 0);
    for (std::size_t i = 0; i < a.size(); ++i)
      for (std::size_t j = 0; j < b.size(); ++j) betti[i + j] += a[i] * b[j];
    return betti;
  }
  double Reach() const override { return std::min(a_->Reach(), b_->Reach()); }
  MatrixXd Seeds() const override {
    const MatrixXd a = a_->Seeds(), b = b_->Seeds();
    MatrixXd seeds(d(), a.cols() * b.cols());
    for (Eigen::Index i = 0; i < a.cols(); ++i)
      for (Eigen::Index j = 0; j < b.cols(); ++j) seeds.col(i * b.cols() + j) << a.col(i), b.col(j);
    return seeds;
  }
  double Radius() const override { return std::hypot(a_->Radius(), b_->Radius()); }
  int Component(const VectorXd& y) const override {
    return a_->Component(y.head(a_->d())) * b_->Betti().front() + b_->Component(y.tail(b_->d()));
  }

 private:
  ShapePtr a_, b_;
};

class SpheresShape final : public Shape {
 public:
  SpheresShape(int k, MatrixXd centres, std::vector<double> radii)
      : k_(k), centres_(std::move(centres)), radii_(std::move(radii)) {}
  int k() const override { return k_; }
  int d() const override { return k_ + 1; }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    double least = kInfinity;
    VectorXd y, normal;
    for (std::size_t i = 0; i < radii_.size(); ++i) {
      double length = 0;
      const VectorXd out = UnitOr(x - Centre(i), &length);
      if (std::abs(length - radii_[i]) >= least) continue;
      least = std::abs(length - radii_[i]);
      y = Centre(i) + radii_[i] * out;
      normal = out;
    }
    if (tangent) *tangent = Across(normal);
    return y;
  }
  std::vector<int> Betti() const override {
    std::vector<int> betti(static_cast<std::size_t>(k_) + 1, 0);
    betti.front() = betti.back() = static_cast<int>(radii_.size());
    return betti;
  }
  double Reach() const override {
    double reach = *std::min_element(radii_.begin(), radii_.end());
    for (std::size_t i = 0; i < radii_.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const double apart = (Centre(i) - Centre(j)).norm();
        const double gap =
            std::max(apart - radii_[i] - radii_[j], std::abs(radii_[i] - radii_[j]) - apart);
        reach = std::min(reach, gap / 2);
      }
    }
    return reach;
  }
  MatrixXd Seeds() const override {
    MatrixXd seeds = centres_;
    for (std::size_t i = 0; i < radii_.size(); ++i)
      seeds.col(static_cast<Eigen::Index>(i)) += radii_[i] * VectorXd::Unit(d(), 0);
    return seeds;
  }
  double Radius() const override {
    double most = 0;
    for (std::size_t i = 0; i < radii_.size(); ++i)
      most = std::max(most, Centre(i).norm() + radii_[i]);
    return 1.05 * most;
  }
  int Component(const VectorXd& y) const override {
    std::size_t best = 0;
    const auto off = [&](std::size_t i) { return std::abs((y - Centre(i)).norm() - radii_[i]); };
    for (std::size_t i = 1; i < radii_.size(); ++i)
      if (off(i) < off(best)) best = i;
    return static_cast<int>(best);
  }

 private:
  VectorXd Centre(std::size_t i) const { return centres_.col(static_cast<Eigen::Index>(i)); }

  int k_;
  MatrixXd centres_;
  std::vector<double> radii_;
};

class PlacedShape final : public Shape {
 public:
  PlacedShape(ShapePtr shape, int d, std::mt19937_64& random) : shape_(std::move(shape)) {
    std::normal_distribution<double> normal;
    MatrixXd any(d, shape_->d());
    for (double& x : any.reshaped()) x = normal(random);
    turn_ = Eigen::HouseholderQR<MatrixXd>(any).householderQ() * MatrixXd::Identity(d, shape_->d());
  }
  int k() const override { return shape_->k(); }
  int d() const override { return static_cast<int>(turn_.rows()); }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    const VectorXd y = turn_ * shape_->Closest(turn_.transpose() * x, tangent);
    if (tangent) *tangent = turn_ * *tangent;
    return y;
  }
  std::vector<int> Betti() const override { return shape_->Betti(); }
  double Reach() const override { return shape_->Reach(); }
  MatrixXd Seeds() const override { return turn_ * shape_->Seeds(); }
  double Radius() const override { return shape_->Radius(); }
  int Component(const VectorXd& y) const override {
    return shape_->Component(turn_.transpose() * y);
  }

 private:
  ShapePtr shape_;
  MatrixXd turn_;
};

// A shape that lies about itself: no mesh of it is right.
class Pretender : public Shape {
 public:
  std::vector<int> Betti() const override { return {}; }
  double Reach() const override { return 0; }
  MatrixXd Seeds() const override { return Closest(VectorXd::Unit(d(), 0), nullptr); }
  double Radius() const override { return 1.5; }
  int Component(const VectorXd&) const override { return 0; }
};

class Wire final : public Pretender {
 public:
  explicit Wire(double radius) : torus_(Revolution({Circle(1, 0, radius)}, false, 1)) {}
  int k() const override { return 1; }
  int d() const override { return 3; }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    MatrixXd both;
    const VectorXd y = torus_->Closest(x, tangent ? &both : nullptr);
    if (tangent) *tangent = both.rightCols(1);
    return y;
  }

 private:
  ShapePtr torus_;
};

class Shell final : public Pretender {
 public:
  explicit Shell(double thick) : thick_(thick) {}
  int k() const override { return 2; }
  int d() const override { return 3; }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    double length = 0;
    const VectorXd out = UnitOr(x, &length);
    if (tangent) *tangent = Across(out);
    return std::clamp(length, 1 - thick_, 1.0) * out;
  }

 private:
  double thick_;
};

class Capless final : public Pretender {
 public:
  explicit Capless(double hole) : hole_(hole) {}
  int k() const override { return 2; }
  int d() const override { return 3; }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    double length = 0;
    VectorXd out = UnitOr(x, &length);
    const double most = std::sqrt(1 - hole_ * hole_);
    if (out[2] > most) {
      out.head(2) = hole_ * out.head(2).normalized();
      out[2] = most;
    }
    if (tangent) *tangent = Across(out);
    return out;
  }

 private:
  double hole_;
};

}  // namespace

ShapePtr Curves(std::vector<Curve> curves) {
  return std::make_shared<CurvesShape>(std::move(curves));
}
ShapePtr Revolution(std::vector<Curve> profiles, bool symmetric, int m) {
  return std::make_shared<RevolutionShape>(std::move(profiles), symmetric, m);
}
ShapePtr Product(ShapePtr a, ShapePtr b) {
  return std::make_shared<ProductShape>(std::move(a), std::move(b));
}
ShapePtr Spheres(int k, MatrixXd centres, std::vector<double> radii) {
  return std::make_shared<SpheresShape>(k, std::move(centres), std::move(radii));
}
ShapePtr Placed(ShapePtr shape, int d, std::mt19937_64& random) {
  return std::make_shared<PlacedShape>(std::move(shape), d, random);
}
ShapePtr WireAsCurve(double radius) { return std::make_shared<Wire>(radius); }
ShapePtr ShellAsSurface(double thick) { return std::make_shared<Shell>(thick); }
ShapePtr SphereWithoutCap(double hole) { return std::make_shared<Capless>(hole); }

Answer ShapeOracle::ClosestPoint(const MatrixXd& x) {
  const int d = shape_->d(), k = shape_->k();
  asked_ += static_cast<std::uint64_t>(x.cols());
  Answer answer;
  answer.points.resize(d, x.cols());
  if (tangents_) answer.tangents.resize(d * k, x.cols());
  MatrixXd tangent;
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    answer.points.col(j) = shape_->Closest(x.col(j), tangents_ ? &tangent : nullptr);
    if (notes_ && shape_->walls() == 0) components_.insert(shape_->Component(answer.points.col(j)));
    if (!tangents_) continue;
    for (int i = 0; i < d; ++i)
      for (int a = 0; a < k; ++a) answer.tangents(i * k + a, j) = tangent(i, a);
  }
  return answer;
}

std::optional<BoundingBox> ShapeOracle::bounding_box() const {
  const double half = box_ * shape_->Radius();
  return BoundingBox{VectorXd::Constant(shape_->d(), -half), VectorXd::Constant(shape_->d(), half)};
}

}  // namespace stellate::truth
