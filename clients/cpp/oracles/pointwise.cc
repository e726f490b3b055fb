#include "stellate/pointwise.h"

#include <Eigen/LU>
#include <cmath>

namespace stellate {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kMaxFlatIterations = 60;
constexpr double kSmallestFlatStep = 1e-4;  // of a full Newton step, before giving up on it
constexpr double kRounding = 4e-16;         // relative; no residual is worth improving below it

}  // namespace

Answer PointwiseOracle::ClosestPoint(const Eigen::MatrixXd& x) {
  Answer answer;
  answer.points.setZero(ambient_dimension_, x.cols());
  answer.found.assign(static_cast<size_t>(x.cols()), 0);
  Eigen::VectorXd from, to(ambient_dimension_);
  for (Eigen::Index j = 0; j < x.cols(); ++j) {
    from = x.col(j);
    if (!Project(from, to)) continue;
    answer.points.col(j) = to;
    answer.found[static_cast<size_t>(j)] = 1;
  }
  return answer;
}

Answer PointwiseOracle::IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                                      const Eigen::VectorXd& radii) {
  Answer answer;
  answer.points.setZero(ambient_dimension_, centers.cols());
  answer.found.assign(static_cast<size_t>(centers.cols()), 0);
  Eigen::VectorXd center, level, m(ambient_dimension_);
  Eigen::MatrixXd basis;
  for (Eigen::Index j = 0; j < centers.cols(); ++j) {
    center = centers.col(j);
    basis = Eigen::Map<const RowMajor>(bases.col(j).data(), ambient_dimension_, dimension_);
    level = basis.transpose() * center;
    if (!Meet(center, basis, level, m) || (m - center).norm() > radii[j]) continue;
    answer.points.col(j) = m;
    answer.found[static_cast<size_t>(j)] = 1;
  }
  return answer;
}

Eigen::MatrixXd PointwiseOracle::TangentBasis(const Eigen::MatrixXd& points) {
  Eigen::MatrixXd bases(ambient_dimension_ * dimension_, points.cols());
  Eigen::VectorXd point;
  Eigen::MatrixXd tangent(ambient_dimension_, dimension_);
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    point = points.col(j);
    Tangent(point, tangent);
    Eigen::Map<RowMajor>(bases.col(j).data(), ambient_dimension_, dimension_) = tangent;
  }
  return bases;
}

Eigen::VectorXd PointwiseOracle::LocalSize(const Eigen::MatrixXd& points) {
  Eigen::VectorXd sizes(points.cols()), point;
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    point = points.col(j);
    sizes[j] = SizeAt(point);
  }
  return sizes;
}

double PointwiseOracle::SizeAt(const Eigen::VectorXd& /*y*/) const {
  throw std::logic_error("this oracle has no local sizes");
}

bool PointwiseOracle::Meet(const Eigen::VectorXd& start, const Eigen::MatrixXd& basis,
                           const Eigen::VectorXd& level, Eigen::VectorXd& m) const {
  if (!Project(start, m)) return false;
  Eigen::VectorXd residual = basis.transpose() * m - level;
  const double scale = 1 + level.norm() + m.norm();
  Eigen::MatrixXd tangent(ambient_dimension_, dimension_);
  Eigen::VectorXd next(ambient_dimension_), next_residual;
  for (int i = 0; i < kMaxFlatIterations && residual.norm() > kRounding * scale; ++i) {
    Tangent(m, tangent);
    const Eigen::MatrixXd slope = basis.transpose() * tangent;
    Eigen::VectorXd step = slope.partialPivLu().solve(-residual);
    // Where M stands nearly upright on the flat's tangent the linear model is worth little.
    const double longest = 10 * residual.norm();
    if (!step.allFinite()) return false;
    if (step.norm() > longest) step *= longest / step.norm();
    double fraction = 1;
    for (; fraction >= kSmallestFlatStep; fraction /= 2) {
      if (!Project(m + fraction * (tangent * step), next)) continue;
      next_residual = basis.transpose() * next - level;
      if (next_residual.norm() < residual.norm()) break;
    }
    if (fraction < kSmallestFlatStep) break;  // no better point: rounding, or no intersection
    m = next;
    residual = next_residual;
  }
  return residual.norm() <= kFlatTolerance * scale;
}

}  // namespace stellate
