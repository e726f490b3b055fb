#pragma once

#include <Eigen/Core>

#include "stellate/oracle.h"

namespace stellate {

// An oracle written one point at a time: implement Project, the closest point, and Tangent, the
// tangent space there. Batches and flat intersections follow.
//
//   struct Circle : stellate::PointwiseOracle {
//     Circle() : PointwiseOracle(1, 2) {}
//     bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override {
//       y = x.normalized();
//       return x.norm() > 0;
//     }
//     void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const override {
//       tangent = Eigen::Vector2d(-y[1], y[0]);
//     }
//     Eigen::MatrixXd seeds() const override { return Eigen::Vector2d(1, 0); }
//   };
//
// Project, Tangent and SizeAt must be safe to call from several threads.
class PointwiseOracle : public Oracle {
 public:
  int dimension() const final { return dimension_; }
  int ambient_dimension() const final { return ambient_dimension_; }
  bool has_intersect_flat() const override { return true; }
  bool has_tangent_basis() const override { return true; }

  Answer ClosestPoint(const Eigen::MatrixXd& x) override;
  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override;
  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override;
  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override;

  // Sets y to a point of M nearest to x. False: none was found.
  virtual bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const = 0;
  // Sets tangent (d x k) to an orthonormal basis of the tangent space at y, a point of M.
  virtual void Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const = 0;

  // The size at y, a point of M: override it together with has_local_size.
  virtual double SizeAt(const Eigen::VectorXd& y) const;

  // Sets m to the point of M with basis^T m = level that Newton's method along M reaches from the
  // closest point of `start`. That is the nearest one if M is nearly flat on the way. False: it
  // does not converge. `basis` (d x k) need not be orthonormal.
  //
  // Accuracy: |basis^T m - level| is at most kFlatTolerance (1 + |level| + |m|), mostly near
  // rounding; m is as near M as Project puts it.
  bool Meet(const Eigen::VectorXd& start, const Eigen::MatrixXd& basis,
            const Eigen::VectorXd& level, Eigen::VectorXd& m) const;

  // A thousand times what double precision attains on a well placed flat, and a thousand times
  // finer than what servers check.
  static constexpr double kFlatTolerance = 1e-12;

 protected:
  PointwiseOracle(int dimension, int ambient_dimension)
      : dimension_(dimension), ambient_dimension_(ambient_dimension) {}

 private:
  int dimension_, ambient_dimension_;
};

}  // namespace stellate
