#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>

#include "stellate/pointwise.h"

namespace stellate {

class Exactness;

// M = { x : F(x) = 0 } for F: R^d -> R^(d-k) whose Jacobian has full rank on M.
//
// Closest points by Newton's method on the Lagrange conditions, started where steepest descent of
// |F| from x first meets M: the nearest point when x is nearer to M than its reach, a critical
// point of the distance otherwise. Points that do not converge are reported as not found.
//
// Throws OracleError from the queries if f rounds to single precision, or returns a wrong shape.
class ImplicitOracle : public PointwiseOracle {
 public:
  using Function = std::function<Eigen::VectorXd(const Eigen::VectorXd& x)>;  // d -> d-k
  using Jacobian = std::function<Eigen::MatrixXd(const Eigen::VectorXd& x)>;  // d -> (d-k) x d

  // An empty `jacobian` is replaced by central differences of f, which cost 2d calls and about half
  // of the digits of the tangents; the points stay accurate. Throws std::invalid_argument unless
  // 1 <= k < d and the box is one of R^d, lower < upper.
  ImplicitOracle(int dimension, int ambient_dimension, Function f, Jacobian jacobian,
                 BoundingBox box);

  std::optional<BoundingBox> bounding_box() const override { return box_; }

  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
  void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override;
  int equations() const override { return ambient_dimension() - dimension(); }
  Eigen::MatrixXd EquationGradients(const Eigen::MatrixXd& points) override;

 private:
  Eigen::VectorXd F(const Eigen::VectorXd& x) const;
  bool Correct(Eigen::VectorXd& y) const;  // onto M, along the normals
  bool Descend(const Eigen::VectorXd& x, Eigen::VectorXd& y, double* slope) const;
  Eigen::MatrixXd J(const Eigen::VectorXd& x) const;

  Function f_;
  Jacobian jacobian_;
  BoundingBox box_;
  std::shared_ptr<const Exactness> exactness_;
  double length_;    // of the box's diagonal: the unit of every tolerance
  double rounding_;  // of points in the box, a length: no step can be asked to be shorter
};

}  // namespace stellate
