#include <utility>

#include "stellate/catalogue.h"

namespace stellate {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// factor * x, column by column: a product of whole matrices rounds each column as its place among
// the others has it, and then answers would depend on how a round is cut into chunks.
template <typename Factor>
Eigen::MatrixXd EachTimes(const Factor& factor, const Eigen::MatrixXd& x) {
  Eigen::MatrixXd product(factor.rows(), x.cols());
  Eigen::VectorXd column(x.rows()), result(factor.rows());
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    column = x.col(j);
    result.noalias() = factor * column;
    product.col(j) = result;
  }
  return product;
}

}  // namespace

Manifold::Manifold(std::unique_ptr<PointwiseOracle> shape, ManifoldFacts facts,
                   Eigen::MatrixXd frame)
    : shape_(std::move(shape)), facts_(std::move(facts)), frame_(std::move(frame)) {}

Answer Manifold::ClosestPoint(const Eigen::MatrixXd& x) {
  if (frame_.size() == 0) return shape_->ClosestPoint(x);
  Answer answer = shape_->ClosestPoint(EachTimes(frame_.transpose(), x));
  answer.points = EachTimes(frame_, answer.points);
  return answer;
}

Answer Manifold::IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                               const Eigen::VectorXd& radii) {
  if (frame_.size() == 0) return shape_->IntersectFlat(centers, bases, radii);
  // With y = Q z, the flat { T^t y = T^t c } becomes { (Q^t T)^t z = T^t c } in the shape's space.
  const int d = ambient_dimension(), k = dimension();
  const Eigen::MatrixXd starts = EachTimes(frame_.transpose(), centers);
  Answer answer;
  answer.points.setZero(d, centers.cols());
  answer.found.assign(static_cast<size_t>(centers.cols()), 0);
  Eigen::VectorXd m(shape_->ambient_dimension()), center;
  Eigen::MatrixXd basis;
  for (Eigen::Index j = 0; j < centers.cols(); ++j) {
    center = centers.col(j);
    basis = Eigen::Map<const RowMajor>(bases.col(j).data(), d, k);
    const Eigen::VectorXd level = basis.transpose() * center;
    if (!shape_->Meet(starts.col(j), frame_.transpose() * basis, level, m)) continue;
    answer.points.col(j).noalias() = frame_ * m;
    const double distance = (answer.points.col(j) - centers.col(j)).norm();
    answer.found[static_cast<size_t>(j)] = distance <= radii[j] ? 1 : 0;
  }
  return answer;
}

Eigen::MatrixXd Manifold::TangentBasis(const Eigen::MatrixXd& points) {
  if (frame_.size() == 0) return shape_->TangentBasis(points);
  const int d = ambient_dimension(), k = dimension(), inner = shape_->ambient_dimension();
  const Eigen::MatrixXd small = shape_->TangentBasis(EachTimes(frame_.transpose(), points));
  Eigen::MatrixXd bases(d * k, points.cols());
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    Eigen::Map<RowMajor>(bases.col(j).data(), d, k).noalias() =
        frame_ * Eigen::Map<const RowMajor>(small.col(j).data(), inner, k);
  }
  return bases;
}

// An isometry moves the medial axis along.
Eigen::VectorXd Manifold::LocalSize(const Eigen::MatrixXd& points) {
  if (frame_.size() == 0) return shape_->LocalSize(points);
  return shape_->LocalSize(EachTimes(frame_.transpose(), points));
}

std::optional<BoundingBox> Manifold::bounding_box() const {
  std::optional<BoundingBox> box = shape_->bounding_box();
  if (!box || frame_.size() == 0) return box;
  // The smallest axis-aligned box about the turned one, with room where the frame is thin.
  const Eigen::VectorXd center = frame_ * (box->upper + box->lower) / 2;
  const Eigen::VectorXd half = frame_.cwiseAbs() * (box->upper - box->lower) / 2;
  const Eigen::VectorXd least = Eigen::VectorXd::Constant(half.size(), 1e-3 * half.maxCoeff());
  return BoundingBox{center - half.cwiseMax(least), center + half.cwiseMax(least)};
}

Eigen::VectorXd Manifold::Distance(const Eigen::MatrixXd& x) {
  return (x - ClosestPoint(x).points).colwise().norm().transpose();
}

}  // namespace stellate
