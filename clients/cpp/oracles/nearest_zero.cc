// Nearest points of {F = 0}, by Lagrange-Newton.
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "oracles/equation_system.h"

namespace stellate {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr double kClose = 1e-4;    // of |F| at x, from where steps go down and along at once
constexpr double kCoarse = 1e-11;  // a tolerance, of the box: differences are not that exact
// Of these steps each is shorter than the last by that factor.
constexpr int kWalked = 10;
constexpr double kContracts = 0.5, kExpected = 0.1;  // and what the second of them is taken to be
constexpr double kLeast = 0.01;                      // of the distance's Hessian where they begin
constexpr double kLeft = 1, kNoise = 1e4;            // tolerances: left in the end; that may grow
constexpr double kTold = 0.1;  // of a step along M, by which it has to go across to tell of that
// In shares of the box: how far x is from M where its Jacobian is of no use; a step after which the
// next may be the last, and one after which bends are others; and, squared, a distance times the
// step of one-sided differences, which turn normals so long by more than is left in the end.
constexpr double kRemote = 1e-3, kLate = 1e-4, kBent = 1e-3, kTurns = 3e-11;

constexpr double kLeastBend = 0.1;  // of the distance's Hessian, below which no step is long enough
constexpr double kLongestAlong = 0.1;  // step along M, in shares of the box
constexpr double kArrived = 1e-9;      // likewise; and the step squares what error is left
constexpr int kHalvings = 10;  // of a step along M: where all are too long there is a crease
constexpr int kLanding = 20;   // steps down to M from a step along it
// Ten steps along M, from the sixth on, have to become shorter by a factor of 0.7 or come nearer by
// a thousandth: what is slower, as at creases, does not arrive. Steps that grow leave a saddle.
constexpr int kFrom = 5, kPatience = 10;
constexpr double kShorter = 0.7, kNearer = 1e-3, kGrown = 1.2;

// Lagrange's multipliers (m), at a point x + off.
VectorXd MultipliersOf(const MatrixXd& jacobian, const VectorXd& off) {
  const MatrixXd gram = jacobian * jacobian.transpose();
  return -gram.partialPivLu().solve(jacobian * off);
}

// Of the distance along M: I + the sum of the bends (k x mk), by their multipliers.
MatrixXd HessianOf(const MatrixXd& bends, const VectorXd& multipliers) {
  const Index k = bends.rows();
  MatrixXd hessian = MatrixXd::Identity(k, k);
  for (Index i = 0; i < multipliers.size(); ++i) {
    hessian += multipliers[i] * bends.middleCols(i * k, k);
  }
  return hessian;
}

// A point on its way down to M and along it at once, from near it; given up unless all steps become
// shorter. F is measured along M alone, where it hardly changes, and its bends there once; across M
// the Jacobian is corrected by what steps see (Broyden).
class Walk {
 public:
  Walk(const EquationSystem& system, const VectorXd& x, const Descent& begun)
      : system_(system), x_(x), now_(begun), last_(std::numeric_limits<double>::infinity()) {}

  std::optional<VectorXd> ToItsEnd() {
    for (int number = 0; number < kWalked; ++number) {
      Measure(number == 0);
      if (!Step(number == 0)) return std::nullopt;
      if (ends_) return Land();
      Learn();
    }
    return std::nullopt;
  }

 private:
  double distance() const { return (now_.point - x_).norm(); }

  // The Jacobian along the ways, and the bends.
  void Measure(bool first) {
    const double scale = system_.scale();
    ways_ = NullSpace(now_.slopes);
    // Of several equations all slopes matter to multipliers, and those so far were seen far from
    // here.
    if (first && now_.value.size() > 1 && distance() > kRemote * scale) {
      const Index d = x_.size();
      now_.slopes = system_.Slopes(now_.point, MatrixXd::Identity(d, d), &now_.value);
      ways_ = NullSpace(now_.slopes);
    }
    // Whether one-sided differences would turn normals so long by more than is left in the end.
    const bool far = distance() * system_.seen_over() > kTurns * scale * scale;
    const bool exact = far && last_ <= kLate * scale;
    const double seen_over = exact ? 0 : system_.seen_over();
    MatrixXd slopes = system_.Slopes(now_.point, ways_, exact ? nullptr : &now_.value);
    if (first || last_ > kBent * scale) {
      frame_ = ways_;
      framed_ = system_.Bends(now_.point, now_.value, ways_, slopes, seen_over);
    }
    const MatrixXd turn = frame_.transpose() * ways_;
    const Index k = ways_.cols();
    bends_.resize(k, framed_.cols());
    for (Index i = 0; i < now_.value.size(); ++i) {
      bends_.middleCols(i * k, k) = turn.transpose() * framed_.middleCols(i * k, k) * turn;
      slopes.row(i) -= seen_over / 2 * bends_.middleCols(i * k, k).diagonal().transpose();
    }
    now_.slopes += (slopes - now_.slopes * ways_) * ways_.transpose();
    is_sure_ = exact || !far;
  }

  // Takes the next step; false where it is none that leads to the end.
  bool Step(bool first) {
    const VectorXd off = now_.point - x_;
    const MatrixXd slopes = now_.slopes * ways_;
    const VectorXd multipliers = MultipliersOf(now_.slopes, off);
    const MatrixXd hessian = HessianOf(bends_, multipliers);
    if (!hessian.allFinite()) return false;
    // Of the Lagrangian: to it ways that are not quite along M do not matter.
    const VectorXd gradient = ways_.transpose() * off + slopes.transpose() * multipliers;
    along_ = -hessian.partialPivLu().solve(gradient);
    const VectorXd across = NormalStep(now_.slopes, now_.value + slopes * along_);
    step_ = ways_ * along_ + across;
    const double length = step_.norm(), tolerance = system_.tolerance();
    if (first) {
      const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(hessian, Eigen::EigenvaluesOnly);
      if (!(solver.eigenvalues()[0] >= kLeast && length <= kLongestAlong * system_.scale()))
        return false;
    } else if (!(length <= std::max(kContracts * last_, kNoise * tolerance))) {
      return false;
    }
    double left = first ? kExpected * length : length * std::min(length / last_, kContracts);
    // What a step across M turns the normals by is not foreseen.
    const Index k = hessian.rows();
    const double bent = (hessian - MatrixXd::Identity(k, k)).cwiseAbs().maxCoeff();
    left = std::max(left, bent * across.norm());
    now_.point += step_;
    now_.last_step = last_ = length;
    ends_ = is_sure_ && left <= kLeft * tolerance;
    return true;
  }

  // F where the step has led, and what that says of the Jacobian across M; along it the bends do.
  void Learn() {
    const Index k = ways_.cols();
    const VectorXd seen = system_.Values(now_.point);
    MatrixXd turns(seen.size(), k);
    for (Index i = 0; i < seen.size(); ++i) {
      turns.row(i) = (bends_.middleCols(i * k, k) * along_).transpose();
    }
    const VectorXd change = seen - now_.value - now_.slopes * step_ - turns * along_ / 2;
    const VectorXd across = step_ - ways_ * (ways_.transpose() * step_);
    now_.slopes += turns * ways_.transpose();
    if (across.norm() > kTold * along_.norm()) {
      now_.slopes += change * across.transpose() / across.squaredNorm();
    }
    now_.value = seen;
  }

  std::optional<VectorXd> Land() const {
    Beginning beginning;
    beginning.slopes = &now_.slopes;
    beginning.came = &now_;
    const Descent landed = system_.Drive(now_.point, beginning);
    if (!landed.arrived) return std::nullopt;
    return landed.point;
  }

  const EquationSystem& system_;
  const VectorXd& x_;
  Descent now_;
  double last_;  // length of a step
  MatrixXd ways_, frame_, framed_,
      bends_;  // along M; that the first bends are of, they, and of now
  VectorXd along_, step_;
  bool is_sure_ = false, ends_ = false;
};

// How the steps of a point on its way along M become shorter.
class Pace {
 public:
  // Whether the point has gained too little since it was last looked at, if it is time.
  bool IsTooSlow(int iteration, double length, double distance) {
    shortest_ = std::min(shortest_, length);
    if (iteration % kPatience != kFrom) return false;
    const bool is_slow = kShorter * before_ < shortest_ && shortest_ < kGrown * before_ &&
                         distance > (1 - kNearer) * distance_;
    before_ = shortest_;
    distance_ = distance;
    shortest_ = std::numeric_limits<double>::infinity();
    return is_slow;
  }

 private:
  // The shortest of these ten steps and of those before, and how far x was then.
  double shortest_ = std::numeric_limits<double>::infinity(), before_ = shortest_,
         distance_ = shortest_;
};

// The tangent step at y in M towards the point nearest to x.
VectorXd StepAlong(const EquationSystem& system, const VectorXd& x, Descent* y) {
  y->slopes = system.SlopesAt(y->point);
  const MatrixXd tangents = NullSpace(y->slopes);
  const VectorXd off = y->point - x;
  const MatrixXd none = MatrixXd::Zero(y->value.size(), tangents.cols());
  const MatrixXd bends = system.Bends(y->point, y->value, tangents, none, 0);
  MatrixXd hessian = HessianOf(bends, MultipliersOf(y->slopes, off));
  if (!hessian.allFinite()) hessian.setIdentity();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(hessian);
  // Downhill beyond the focal set, too.
  const VectorXd steep = solver.eigenvalues().cwiseAbs().cwiseMax(kLeastBend);
  const VectorXd gradient = tangents.transpose() * off;
  const VectorXd along = (solver.eigenvectors().transpose() * gradient).cwiseQuotient(steep);
  return -tangents * (solver.eigenvectors() * along);
}

// First down to M, then along it, by steps that bring it nearer to x, or are halved until they do.
std::optional<VectorXd> Watch(const EquationSystem& system, const VectorXd& x,
                              const VectorXd& start) {
  Descent y = system.Drive(start);
  if (!y.arrived) return std::nullopt;
  const double scale = system.scale(), tolerance = system.tolerance();
  Pace pace;
  for (int iteration = 0; iteration < EquationSystem::kMaxSteps; ++iteration) {
    VectorXd step = StepAlong(system, x, &y);
    const double length = step.norm(), before = (y.point - x).norm();
    if (!std::isfinite(length) || pace.IsTooSlow(iteration, length, before)) return std::nullopt;
    step *= std::min(1.0, kLongestAlong * scale / std::max(length, 1e-300));
    const bool arrives = length <= std::max(kArrived * scale, tolerance);
    // Near the minimum distances no longer tell better from worse.
    const double slack = length <= std::sqrt(tolerance * scale) ? tolerance : 0;
    Beginning beginning;
    beginning.slopes = &y.slopes;
    beginning.most = kLanding;
    Descent there = system.Drive(y.point + step, beginning);
    double after = (there.point - x).norm();
    bool better = there.arrived && (after < before || (slack > 0 && after <= before + slack));
    for (int i = 0; i < kHalvings && !better && !arrives; ++i) {
      step /= 2;
      beginning.slopes = nullptr;
      there = system.Drive(y.point + step, beginning);
      after = (there.point - x).norm();
      better = there.arrived && after < before;
    }
    if (better) y = there;
    if (arrives) return y.point;
    if (!better) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace

std::optional<VectorXd> NearestZero(const EquationSystem& system, const VectorXd& x,
                                    const VectorXd& start) {
  if (x.size() == system.equations()) {  // points alone
    Descent landed = system.Drive(start);
    if (!landed.arrived) return std::nullopt;
    return std::move(landed.point);
  }
  if (system.tolerance() > kCoarse * system.scale()) return Watch(system, x, start);
  Beginning beginning;
  beginning.enough = kClose;
  const Descent begun = system.Drive(start, beginning);
  if (!begun.arrived) return std::nullopt;
  std::optional<VectorXd> walked = Walk(system, x, begun).ToItsEnd();
  return walked ? walked : Watch(system, x, begun.point);
}

}  // namespace stellate
