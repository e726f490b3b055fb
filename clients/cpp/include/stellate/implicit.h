#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>

#include "stellate/pointwise.h"

namespace stellate {

class EquationSystem;
class Exactness;

// M = { x : F(x) = 0 } for F: R^d -> R^(d-k) whose Jacobian has full rank on M.
//
//   const auto f = [](const Eigen::VectorXd& x) {
//     return Eigen::VectorXd::Constant(1, x.squaredNorm() - 1);
//   };
//   const stellate::BoundingBox box = {Eigen::Vector3d::Constant(-2),
//   Eigen::Vector3d::Constant(2)}; stellate::ImplicitOracle sphere(2, 3, f, {}, box);
//
// Closest points by Newton's method on the Lagrange conditions, down to M and along it together:
// the nearest point when x is nearer to M than its reach, a local minimum of the distance
// otherwise. Points that do not converge are reported as not found.
//
// Throws OracleError from the queries if f rounds to single precision, returns a wrong shape, or
// has no finite derivatives at a point of M.
class ImplicitOracle : public PointwiseOracle {
 public:
  using Function = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;  // d -> d-k
  using Jacobian = std::function<Eigen::MatrixXd(const Eigen::VectorXd& x)>;  // d -> (d-k) x d

  // An empty `jacobian` is replaced by differences of f, which cost two to three times as many
  // calls and some digits of the tangents; the points stay accurate. Throws std::invalid_argument
  // unless 1 <= k < d and the box is one of R^d, lower < upper.
  ImplicitOracle(int dimension, int ambient_dimension, Function f, Jacobian jacobian,
                 BoundingBox box);

  std::optional<BoundingBox> bounding_box() const override { return box_; }

  // By Newton's method within each flat, from its center, and from the point of the flat nearest to
  // the center's closest point where that fails.
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override;
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override;
  int equations() const override { return ambient_dimension() - dimension(); }
  Eigen::MatrixXd EquationGradients(const Eigen::MatrixXd& points) override;
  // Of the same functions: what a class that derives from this does otherwise is not in it.
  std::shared_ptr<Oracle> DividedBy(const Eigen::VectorXd& scale) const override;

  // F with its solver, for oracles of this library that are made of this one.
  const EquationSystem& system() const;

 private:
  Function f_;
  Jacobian jacobian_;  // may be empty
  BoundingBox box_;
  std::shared_ptr<const Exactness> exactness_;
  std::shared_ptr<const EquationSystem> system_;  // of f_, whose shapes are looked at
};

}  // namespace stellate
