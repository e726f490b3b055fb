#include <algorithm>
#include <utility>

#include "tests/truth/shapes.h"

namespace stellate::truth {
namespace {

// The unit ball without a smaller one. Its skins are two walls, or one together.
class Hollow final : public Shape {
 public:
  Hollow(VectorXd centre, double radius, bool one_wall)
      : centre_(std::move(centre)), radius_(radius), one_wall_(one_wall) {}

  int k() const override { return d(); }
  int d() const override { return static_cast<int>(centre_.size()); }
  VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const override {
    if (tangent) *tangent = MatrixXd::Identity(d(), d());
    return x;
  }
  std::vector<int> Betti() const override {
    std::vector<int> betti(static_cast<std::size_t>(d()) + 1, 0);
    betti[0] = betti[static_cast<std::size_t>(d()) - 1] = 1;
    return betti;
  }
  double Reach() const override { return 0; }  // it is the boundary that bends
  MatrixXd Seeds() const override { return -0.5 * centre_.normalized(); }
  double Radius() const override { return 1; }
  // The skin that a point is on.
  int Component(const VectorXd& y) const override { return IsInner(y) ? 1 : 0; }
  int parts() const override { return 2; }

  int walls() const override { return one_wall_ ? 1 : 2; }
  VectorXd FacePoint(const VectorXd& x, int wall) const override {
    const bool inner = one_wall_ ? IsInner(x) : wall == 1;
    return inner ? VectorXd(centre_ + radius_ * (x - centre_).normalized()) : x.normalized();
  }
  VectorXd Clearances(const VectorXd& x) const override {
    const double outer = 1 - x.norm(), inner = (x - centre_).norm() - radius_;
    if (one_wall_) return VectorXd::Constant(1, std::min(outer, inner));
    return Eigen::Vector2d(outer, inner);
  }
  VectorXd Conormal(const VectorXd& y, int wall) const override {
    const bool inner = one_wall_ ? IsInner(y) : wall == 1;
    return inner ? VectorXd((centre_ - y).normalized()) : y.normalized();
  }

 private:
  bool IsInner(const VectorXd& x) const { return (x - centre_).norm() - radius_ < 1 - x.norm(); }

  VectorXd centre_;
  double radius_;
  bool one_wall_;
};

}  // namespace

ShapePtr HollowBall(VectorXd centre, double radius, bool one_wall) {
  return std::make_shared<Hollow>(std::move(centre), radius, one_wall);
}

Answer ShapeOracle::FacePoint(const MatrixXd& x, const Walls& face) {
  const int d = shape_->d();
  Answer answer;
  answer.points = x;
  answer.found.assign(static_cast<std::size_t>(x.cols()), face.size() == 1);
  for (Eigen::Index j = 0; j < x.cols() && face.size() == 1; ++j) {
    answer.points.col(j) = shape_->FacePoint(x.col(j), face.front());
    if (notes_) components_.insert(shape_->Component(answer.points.col(j)));
  }
  answer.tangents = MatrixXd::Identity(d, d).reshaped().replicate(1, x.cols());
  return answer;
}

MatrixXd ShapeOracle::Clearances(const MatrixXd& points) {
  MatrixXd all(shape_->walls(), points.cols());
  for (Eigen::Index j = 0; j < points.cols(); ++j) all.col(j) = shape_->Clearances(points.col(j));
  return all;
}

MatrixXd ShapeOracle::Conormals(const MatrixXd& points, const Walls& face) {
  MatrixXd all =
      MatrixXd::Zero(static_cast<Eigen::Index>(face.size()) * points.rows(), points.cols());
  for (Eigen::Index j = 0; j < points.cols() && face.size() == 1; ++j)
    all.col(j) = shape_->Conormal(points.col(j), face.front());
  return all;
}

}  // namespace stellate::truth
