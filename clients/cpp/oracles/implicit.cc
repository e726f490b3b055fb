#include "stellate/implicit.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "exactness.h"

namespace stellate {
namespace {

constexpr int kMaxIterations = 100;
constexpr double kSmallestStep = 1e-6;
// Relative to the box: where Newton stops since rounding takes over, and what is still accepted.
constexpr double kTarget = 1e-15, kAccepted = 1e-9;
// What the rounding of a point's coordinates makes of a step, in their last bits: F sums a few.
constexpr double kRoundings = 16;
constexpr double kJacobianStep = 6e-6;  // cube root of rounding: best for central differences
constexpr double kHessianStep = 1e-5;

// The normal step that solves jacobian * step = -value with least length.
Eigen::VectorXd NormalStep(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& value) {
  return -jacobian.completeOrthogonalDecomposition().solve(value);
}

}  // namespace

ImplicitOracle::ImplicitOracle(int dimension, int ambient_dimension, Function f, Jacobian jacobian,
                               BoundingBox box)
    : PointwiseOracle(dimension, ambient_dimension),
      f_(std::move(f)),
      jacobian_(std::move(jacobian)),
      box_(std::move(box)),
      exactness_(std::make_shared<const Exactness>("f", box_)) {
  if (dimension < 1 || dimension >= ambient_dimension) {
    throw std::invalid_argument("ImplicitOracle needs 1 <= dimension < ambient_dimension");
  }
  if (box_.lower.size() != ambient_dimension || box_.upper.size() != ambient_dimension) {
    throw std::invalid_argument("ImplicitOracle needs a bounding box of the ambient dimension");
  }
  if (!(box_.lower.array() < box_.upper.array()).all()) {
    throw std::invalid_argument("ImplicitOracle needs a bounding box with lower < upper");
  }
  length_ = (box_.upper - box_.lower).norm();
  const double largest =
      std::max(box_.lower.lpNorm<Eigen::Infinity>(), box_.upper.lpNorm<Eigen::Infinity>());
  rounding_ = kRoundings * std::numeric_limits<double>::epsilon() * largest;
}

Eigen::VectorXd ImplicitOracle::F(const Eigen::VectorXd& x) const {
  Eigen::VectorXd value = f_(x);
  if (value.size() == equations()) return value;
  throw OracleError("ORACLE_SHAPE", "f returned " + std::to_string(value.size()) +
                                        " numbers; they have to be " + std::to_string(equations()) +
                                        ", one for each equation");
}

Eigen::MatrixXd ImplicitOracle::J(const Eigen::VectorXd& x) const {
  if (jacobian_) {
    Eigen::MatrixXd given = jacobian_(x);
    if (given.rows() == equations() && given.cols() == x.size()) return given;
    throw OracleError("ORACLE_SHAPE",
                      "the jacobian returned a matrix " + std::to_string(given.rows()) + " x " +
                          std::to_string(given.cols()) + "; it has to be " +
                          std::to_string(equations()) + " x " + std::to_string(x.size()));
  }
  Eigen::MatrixXd result(ambient_dimension() - dimension(), ambient_dimension());
  const double h = kJacobianStep * length_;
  Eigen::VectorXd y = x;
  for (int i = 0; i < ambient_dimension(); ++i) {
    y[i] = x[i] + h;
    result.col(i) = F(y);
    y[i] = x[i] - h;
    result.col(i) = (result.col(i) - F(y)) / (2 * h);
    y[i] = x[i];
  }
  return result;
}

bool ImplicitOracle::Correct(Eigen::VectorXd& y) const {
  Eigen::VectorXd value = F(y);
  double last_step = length_;
  for (int i = 0; i < kMaxIterations; ++i) {
    Eigen::VectorXd step = NormalStep(J(y), value);
    if (!step.allFinite()) return false;
    last_step = step.norm();
    if (last_step <= kTarget * length_) return true;
    // Far from M the linear model overshoots: a trust radius, then backtracking on |F|.
    if (last_step > 0.1 * length_) step *= 0.1 * length_ / last_step;
    double fraction = 1;
    for (; fraction >= kSmallestStep; fraction /= 2) {
      const Eigen::VectorXd next = y + fraction * step;
      const Eigen::VectorXd next_value = F(next);
      if (next_value.norm() >= value.norm()) continue;
      y = next;
      value = next_value;
      break;
    }
    if (fraction < kSmallestStep) break;
  }
  return last_step <= std::max(kAccepted * length_, rounding_);
}

void ImplicitOracle::Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const {
  // The last k columns of Q in J^T = Q R span the kernel of J.
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(J(y).transpose());
  tangent = Eigen::MatrixXd::Zero(ambient_dimension(), dimension());
  tangent.bottomRows(dimension()).setIdentity();
  tangent.applyOnTheLeft(qr.householderQ());
}

// One step towards the closest point to x along M. `slope` is the length of the tangential part of
// x - y before the step. False when no shorter distance was found.
bool ImplicitOracle::Descend(const Eigen::VectorXd& x, Eigen::VectorXd& y, double* slope) const {
  const int k = dimension();
  Eigen::MatrixXd tangent;
  Tangent(y, tangent);
  const Eigen::VectorXd towards = tangent.transpose() * (x - y);
  *slope = towards.norm();
  if (*slope <= kTarget * length_) return false;
  // The Hessian of the distance along M: I + sum lambda_j U^T (Hess F_j) U, with J^T lambda = x -
  // y.
  const Eigen::MatrixXd jacobian = J(y);
  const Eigen::VectorXd lambda =
      jacobian.transpose().completeOrthogonalDecomposition().solve(x - y);
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Identity(k, k);
  const double h = kHessianStep * length_;
  for (int a = 0; a < k; ++a) {
    const Eigen::MatrixXd difference = J(y + h * tangent.col(a)) - J(y - h * tangent.col(a));
    hessian.col(a) += tangent.transpose() * (difference.transpose() * lambda) / (2 * h);
  }
  const Eigen::LLT<Eigen::MatrixXd> factor((hessian + hessian.transpose()) / 2);
  // Where the distance is not convex the gradient still points downhill.
  const Eigen::VectorXd step =
      factor.info() == Eigen::Success ? Eigen::VectorXd(factor.solve(towards)) : towards;
  const double distance = (x - y).norm();
  for (double fraction = 1; fraction >= kSmallestStep; fraction /= 2) {
    Eigen::VectorXd next = y + fraction * (tangent * step);
    if (!Correct(next) || (x - next).norm() >= distance) continue;
    y = next;
    return true;
  }
  // At the closest point rounding hides any decrease: one plain step is still more accurate.
  if (*slope <= 1e-6 * length_) {
    Eigen::VectorXd next = y + tangent * step;
    if (Correct(next)) y = next;
  }
  return false;
}

bool ImplicitOracle::Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const {
  exactness_->Insist(f_);
  y = x;
  if (!Correct(y)) return false;
  double slope = 0;
  for (int i = 0; i < kMaxIterations && Descend(x, y, &slope); ++i) {
  }
  // The distance is flat to second order: a slope of the root of rounding already is the minimum
  // as far as double precision can tell, and Descend's last step polished it.
  return slope <= 1e-6 * length_;
}

Eigen::MatrixXd ImplicitOracle::EquationGradients(const Eigen::MatrixXd& points) {
  Eigen::MatrixXd gradients(equations() * ambient_dimension(), points.cols());
  for (Eigen::Index j = 0; j < points.cols(); ++j) {
    gradients.col(j) = J(points.col(j)).transpose().reshaped();
  }
  return gradients;
}

}  // namespace stellate
