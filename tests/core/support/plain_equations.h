#pragma once

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "stellate/oracle.h"
#include "stellate/pointwise.h"

namespace stellate::testing {

// Where equations with derivatives are zero: nearest points by plain Newton steps, down and along
// in turn, many evaluations each. The mesher's tests have this solver of their own, so that golden
// files say nothing of what clients ask with.
class PlainEquations final : public PointwiseOracle {
 public:
  using Function = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;  // d -> d-k
  using Jacobian = std::function<Eigen::MatrixXd(const Eigen::VectorXd& x)>;  // d -> (d-k) x d

  // `box`: its diagonal is the unit of lengths.
  PlainEquations(int dimension, int ambient_dimension, Function f, Jacobian jacobian,
                 const BoundingBox& box)
      : PointwiseOracle(dimension, ambient_dimension),
        f_(std::move(f)),
        jacobian_(std::move(jacobian)),
        length_((box.upper - box.lower).norm()),
        rounding_(
            kRoundings * std::numeric_limits<double>::epsilon() *
            std::max(box.lower.lpNorm<Eigen::Infinity>(), box.upper.lpNorm<Eigen::Infinity>())) {}

  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
    y = x;
    if (!Correct(y)) return false;
    double slope = 0;
    for (int i = 0; i < kMaxIterations && Descend(x, y, &slope); ++i) {
    }
    // The distance is flat to second order: a slope of the root of rounding already is the minimum
    // as far as double precision can tell, and Descend's last step polished it.
    return slope <= 1e-6 * length_;
  }

  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
    // The last k columns of Q in J^T = Q R span the kernel of J.
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(J(y).transpose());
    tangent = Eigen::MatrixXd::Zero(ambient_dimension(), dimension());
    tangent.bottomRows(dimension()).setIdentity();
    tangent.applyOnTheLeft(qr.householderQ());
  }

 private:
  static constexpr int kMaxIterations = 100;
  static constexpr double kSmallestStep = 1e-6;
  // Relative to the box: where Newton stops since rounding takes over, and what is accepted.
  static constexpr double kTarget = 1e-15, kAccepted = 1e-9;
  static constexpr double kRoundings = 16;  // of coordinates, that a step cannot go below
  static constexpr double kHessianStep = 1e-5;

  // The normal step that solves jacobian * step = -value with least length.
  static Eigen::VectorXd NormalStep(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& value) {
    return -jacobian.completeOrthogonalDecomposition().solve(value);
  }

  Eigen::VectorXd F(const Eigen::VectorXd& x) const { return f_(x); }
  Eigen::MatrixXd J(const Eigen::VectorXd& x) const { return jacobian_(x); }

  bool Correct(Eigen::VectorXd& y) const {
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

  // One step towards the closest point to x along M. `slope` is the length of the tangential part
  // of x - y before the step. False when no shorter distance was found.
  bool Descend(const Eigen::VectorXd& x, Eigen::VectorXd& y, double* slope) const {
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

  Function f_;
  Jacobian jacobian_;
  double length_, rounding_;
};

}  // namespace stellate::testing
