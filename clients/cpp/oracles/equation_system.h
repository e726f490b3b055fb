#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>

namespace stellate {

// A way down to F = 0, as far as it went.
struct Descent {
  Eigen::VectorXd point;      // d
  Eigen::VectorXd value;      // m, F there; 0 where that goes without saying
  Eigen::MatrixXd slopes;     // m x d, the Jacobian as far as it is known on the way
  Eigen::VectorXd steepness;  // m, the lengths of its rows where it was last computed
  double last_step = 0;       // its length
  bool arrived = false;
};

// What a descent begins with, beyond its point.
struct Beginning {
  const Eigen::MatrixXd* slopes = nullptr;  // m x r, the Jacobian of a point near by, in the ways
  const Descent* came = nullptr;            // the way so far, whose last step may tell the next one
  const Eigen::MatrixXd* ways = nullptr;    // d x r, the directions to move in; none: all
  double enough = 0;                        // of |F| at the start, where less than that will do
  int most = 1000;                          // steps, of kMaxSteps
};

// Equations F(x) = 0, F: R^d -> R^m, with their derivatives, however they are had, and the solver
// that drives them to zero. Throws what the functions throw.
class EquationSystem {
 public:
  static constexpr int kMaxSteps = 100;  // of any way

  using Function = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;
  using Jacobian = std::function<Eigen::MatrixXd(const Eigen::VectorXd& x)>;

  // `equations`: m; `scale`: a length, of the solvers' steps and differences; `largest`:
  // coordinate, whose rounding no step can go below. An empty `jacobian`: differences of f.
  EquationSystem(Function f, Jacobian jacobian, int equations, double scale, double largest);

  // These equations and more: `jacobian` is of the others, and only called if this one has its own.
  EquationSystem With(Function f, Jacobian jacobian, int equations) const;

  int equations() const { return equations_; }
  double scale() const { return scale_; }
  // Of a Newton step, a length: a point that is moved by less is where F is zero.
  double tolerance() const { return tolerance_; }
  // The step of one-sided differences, which err by half of it times the bend; 0 for derivatives.
  double seen_over() const { return jacobian_ ? 0 : difference_; }

  Eigen::VectorXd Values(const Eigen::VectorXd& x) const { return f_(x); }
  // (m x r): the Jacobian along the columns of `ways` (d x r), as given or by central differences;
  // by one-sided ones from the value at x, where that is there.
  Eigen::MatrixXd Slopes(const Eigen::VectorXd& x, const Eigen::MatrixXd& ways,
                         const Eigen::VectorXd* value = nullptr) const;
  Eigen::MatrixXd SlopesAt(const Eigen::VectorXd& x) const;  // m x d, along all coordinates
  // T^t (d^2 F_i) T at y, for T (d x k), a k x k block for each of the m equations, side by side.
  // `slopes` (m x k) along T are differences over `seen_over`, or exact.
  Eigen::MatrixXd Bends(const Eigen::VectorXd& y, const Eigen::VectorXd& value,
                        const Eigen::MatrixXd& ways, const Eigen::MatrixXd& slopes,
                        double seen_over) const;

  // Drives F to zero from `start`; steps are halved until |F| falls. Jacobians are expensive, so
  // that steps share them: each corrects the last by what it has seen (Broyden).
  Descent Drive(const Eigen::VectorXd& start, const Beginning& beginning = {}) const;

 private:
  class Way;

  Function f_;
  Jacobian jacobian_;
  int equations_;
  double scale_, largest_, tolerance_, difference_;
};

// The shortest step to where F is zero, as far as its Jacobian (m x d) says.
Eigen::VectorXd NormalStep(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& value);

// An orthonormal basis (d x (d - m)) of what a matrix (m x d) of full rank maps to zero.
Eigen::MatrixXd NullSpace(const Eigen::MatrixXd& matrix);

// The point of {F = 0} nearest to x, or nothing where none is found: the nearest where x is nearer
// to the set than its reach, a local minimum of the distance otherwise. `start`: where the way to
// it begins.
std::optional<Eigen::VectorXd> NearestZero(const EquationSystem& system, const Eigen::VectorXd& x,
                                           const Eigen::VectorXd& start);

}  // namespace stellate
