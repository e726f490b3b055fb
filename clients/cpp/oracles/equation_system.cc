#include "oracles/equation_system.h"

#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stellate {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr double kRoundingUnit = std::numeric_limits<double>::epsilon();
constexpr double kCentralStep = 6e-6;  // about the cube root of the rounding unit
constexpr double kSecondStep = 1e-4;   // about its fourth root
constexpr int kHalved = 12;            // times at most, as a step is
constexpr double kSlow = 0.25;         // a Jacobian that lowers |F| by less than that is too old
// Of the box: a step so long leads where the Jacobian is another, or to another way down.
constexpr double kFar = 0.02, kLongestDown = 0.25;
// So many steps that leave more than that of |F|, and it is least there.
constexpr double kStill = 0.99;
constexpr int kStops = 2;
constexpr double kShrinks = 1e-3;  // of a step, at the least what the next one is taken to be
constexpr double kAhead = 1e-3;    // of the tolerance: so short, that one need not be looked for
constexpr double kShort = 1e4;     // tolerances: halving such a step could only see noise
// What F may be, in its steepness times the step that is to make it zero: corrections of a Jacobian
// without full rank, as of walls that never meet, grow beyond all bounds, and steps shrink to
// nothing.
constexpr double kOutOfStep = 10;

}  // namespace

// The state of one descent.
class EquationSystem::Way {
 public:
  Way(const EquationSystem& system, const VectorXd& start, const Beginning& beginning)
      : system_(system), beginning_(beginning) {
    now_.point = start;
    now_.value = system.Values(start);
    now_.last_step = std::numeric_limits<double>::quiet_NaN();
    if (beginning.slopes != nullptr) now_.slopes = *beginning.slopes;
    is_old_ = beginning.slopes == nullptr;
    if (!is_old_) now_.steepness = now_.slopes.rowwise().norm();
    if (beginning.came != nullptr) {
      now_.last_step = beginning.came->last_step;
      now_.steepness = beginning.came->steepness;
    }
  }

  Descent ToItsEnd() {
    if (!now_.value.allFinite()) return now_;
    const double enough = beginning_.enough * now_.value.norm();
    const int most = std::min(beginning_.most, kMaxSteps);
    int stills = 0;
    for (int i = 0; i < most && is_alive_ && !now_.arrived; ++i) {
      RenewSlopes();
      const VectorXd step = NextStep();
      if (!step.allFinite()) {
        RenewOrGiveUp();
        continue;
      }
      if (step.norm() <= kShort * system_.tolerance_) {
        TakeShort(step);
      } else {
        now_.last_step = step.norm();
        const double before = now_.value.norm();
        HalveUntilBetter(step * std::min(1.0, kLongestDown * system_.scale_ / step.norm()));
        stills = now_.value.norm() > kStill * before ? stills + 1 : 0;
        if (stills >= kStops) is_alive_ = false;
      }
      if (enough > 0 && is_alive_ && now_.value.norm() <= enough) now_.arrived = true;
    }
    return now_;
  }

 private:
  VectorXd Across(const VectorXd& step) const {
    return beginning_.ways == nullptr ? step : VectorXd(*beginning_.ways * step);
  }

  VectorXd NextStep() const {
    if (beginning_.ways == nullptr) return NormalStep(now_.slopes, now_.value);
    return -now_.slopes.partialPivLu().solve(now_.value);
  }

  void RenewSlopes() {
    if (!is_old_) return;
    const Index d = now_.point.size();
    now_.slopes = beginning_.ways == nullptr
                      ? system_.Slopes(now_.point, MatrixXd::Identity(d, d), &now_.value)
                      : system_.Slopes(now_.point, *beginning_.ways, &now_.value);
    now_.steepness = now_.slopes.rowwise().norm();
    is_old_ = false;
    is_fresh_ = true;
  }

  // Where no step helps: with a Jacobian of another point that is no verdict yet.
  void RenewOrGiveUp() {
    if (is_fresh_) is_alive_ = false;
    is_old_ = true;
  }

  // A step this short lands on M to rounding.
  void TakeShort(const VectorXd& step) {
    const double length = step.norm();
    const auto most = kOutOfStep * length * now_.steepness.array();
    if ((now_.value.array().abs() > most).any()) {
      RenewOrGiveUp();
      return;
    }
    const double shrinks = length / now_.last_step;
    // Not a number where none came before.
    const bool ahead =
        length * std::max(shrinks, kShrinks) <= kAhead * system_.tolerance_ && !std::isnan(shrinks);
    if (shrinks > kSlow) {
      is_old_ = true;
      is_fresh_ = false;
    }
    now_.last_step = length;
    now_.point += Across(step);
    now_.arrived = length <= system_.tolerance_ || ahead;
    if (now_.arrived) {
      now_.value.setZero();
    } else {
      now_.value = system_.Values(now_.point);
    }
  }

  // Takes the longest of step, step / 2, ... that lowers |F|.
  void HalveUntilBetter(VectorXd step) {
    const double size = now_.value.norm();
    double fraction = 1;
    for (int i = 0; i < kHalved; ++i, fraction /= 2, step /= 2) {
      const VectorXd trial = now_.point + Across(step);
      const VectorXd value = system_.Values(trial);
      if (!(value.norm() <= (1 - 1e-4 * fraction) * size)) continue;
      is_fresh_ = false;
      if (value.norm() > kSlow * size || step.norm() > kFar * system_.scale_) {
        is_old_ = true;
      } else {
        const VectorXd missing = value - now_.value - now_.slopes * step;
        now_.slopes += missing * step.transpose() / step.squaredNorm();
      }
      now_.point = trial;
      now_.value = value;
      return;
    }
    RenewOrGiveUp();
  }

  const EquationSystem& system_;
  const Beginning& beginning_;
  Descent now_;
  bool is_old_ = true, is_fresh_ = false, is_alive_ = true;  // the Jacobian twice; the way
};

EquationSystem::EquationSystem(Function f, Jacobian jacobian, int equations, double scale,
                               double largest)
    : f_(std::move(f)),
      jacobian_(std::move(jacobian)),
      equations_(equations),
      scale_(scale),
      largest_(largest),
      tolerance_(std::max(1e-12 * scale, 16 * kRoundingUnit * largest)),
      difference_(2 * scale * std::sqrt(kRoundingUnit * std::max(1.0, largest / scale))) {}

EquationSystem EquationSystem::With(Function f, Jacobian jacobian, int equations) const {
  Jacobian both;
  if (jacobian_) {
    both = [first = jacobian_, second = std::move(jacobian)](const VectorXd& x) {
      const MatrixXd above = first(x), below = second(x);
      MatrixXd all(above.rows() + below.rows(), x.size());
      all << above, below;
      return all;
    };
  }
  Function values = [first = f_, second = std::move(f)](const VectorXd& x) {
    const VectorXd above = first(x), below = second(x);
    VectorXd all(above.size() + below.size());
    all << above, below;
    return all;
  };
  return {std::move(values), std::move(both), equations_ + equations, scale_, largest_};
}

MatrixXd EquationSystem::Slopes(const VectorXd& x, const MatrixXd& ways,
                                const VectorXd* value) const {
  if (jacobian_) return jacobian_(x) * ways;
  MatrixXd slopes(equations_, ways.cols());
  for (Index a = 0; a < ways.cols(); ++a) {
    const double h = value != nullptr ? difference_ : kCentralStep * scale_;
    const VectorXd ahead = x + h * ways.col(a);
    const VectorXd behind = value != nullptr ? x : VectorXd(x - h * ways.col(a));
    const VectorXd change = f_(ahead) - (value != nullptr ? *value : f_(behind));
    // As long as steps have come out, along the ways, which are unit vectors.
    slopes.col(a) = change / (ahead - behind).dot(ways.col(a));
  }
  return slopes;
}

MatrixXd EquationSystem::SlopesAt(const VectorXd& x) const {
  return jacobian_ ? jacobian_(x) : Slopes(x, MatrixXd::Identity(x.size(), x.size()));
}

MatrixXd EquationSystem::Bends(const VectorXd& y, const VectorXd& value, const MatrixXd& ways,
                               const MatrixXd& slopes, double seen_over) const {
  const Index k = ways.cols(), m = value.size();
  const double h = kSecondStep * scale_;
  const auto bend_along = [&](const VectorXd& way, const VectorXd& slope) {
    return VectorXd(2 / (h * h) * (f_(y + h * way) - value - h * slope));
  };
  MatrixXd alone(m, k), bends(k, m * k);
  for (Index a = 0; a < k; ++a) alone.col(a) = bend_along(ways.col(a), slopes.col(a));
  for (Index a = 0; a < k; ++a) {
    for (Index b = a; b < k; ++b) {
      // Slopes that were seen over a step have half of its bend in them.
      const VectorXd bend =
          a == b ? VectorXd(alone.col(a) / (1 - seen_over / h))
                 : VectorXd((bend_along(ways.col(a) + ways.col(b), slopes.col(a) + slopes.col(b)) -
                             alone.col(a) - alone.col(b)) /
                            2);
      for (Index i = 0; i < m; ++i) bends(a, i * k + b) = bends(b, i * k + a) = bend[i];
    }
  }
  return bends;
}

Descent EquationSystem::Drive(const VectorXd& start, const Beginning& beginning) const {
  return Way(*this, start, beginning).ToItsEnd();
}

VectorXd NormalStep(const MatrixXd& jacobian, const VectorXd& value) {
  const MatrixXd gram = jacobian * jacobian.transpose();
  return -jacobian.transpose() * gram.partialPivLu().solve(value);
}

MatrixXd NullSpace(const MatrixXd& matrix) {
  // The last columns of Q in A^T = Q R.
  const Eigen::HouseholderQR<MatrixXd> qr(matrix.transpose());
  const Index d = matrix.cols(), k = d - matrix.rows();
  MatrixXd basis = MatrixXd::Zero(d, k);
  basis.bottomRows(k).setIdentity();
  basis.applyOnTheLeft(qr.householderQ());
  return basis;
}

}  // namespace stellate
