#pragma once

#include <Eigen/Dense>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "stellate/oracle.h"

namespace stellate::truth {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A closed curve x(t) = sum_j a_j cos(j t) + b_j sin(j t), its derivatives exact.
class Curve {
 public:
  // cosines, sines: d x m, the terms of j = 0, 1, ..., m - 1.
  Curve(MatrixXd cosines, MatrixXd sines);

  int d() const { return static_cast<int>(cosines_.rows()); }
  const MatrixXd& samples() const { return samples_; }  // d x n, in order, evenly in t
  VectorXd At(double t) const { return Derivative(t, 0); }
  VectorXd Tangent(double t) const { return Derivative(t, 1).normalized(); }
  // The parameter of a nearest point, and the squared distance to it.
  double Nearest(const VectorXd& x, double* squared) const;

 private:
  VectorXd Derivative(double t, int order) const;

  MatrixXd cosines_, sines_, samples_;
};

// A manifold that is known: its closest points exactly, its Betti numbers, its reach.
class Shape {
 public:
  virtual ~Shape() = default;
  virtual int k() const = 0;
  virtual int d() const = 0;
  // The closest point of x and, where `tangent` is given, an orthonormal basis there (d x k).
  virtual VectorXd Closest(const VectorXd& x, MatrixXd* tangent) const = 0;
  virtual std::vector<int> Betti() const = 0;  // 0..k
  virtual double Reach() const = 0;
  virtual MatrixXd Seeds() const = 0;                  // a point of each component
  virtual double Radius() const = 0;                   // of a ball around the origin that holds it
  virtual int Component(const VectorXd& y) const = 0;  // that a point of it is on, 0 .. b_0 - 1
  // Where knots and links are to be judged: the curves themselves.
  virtual const std::vector<Curve>* curves() const { return nullptr; }
};
using ShapePtr = std::shared_ptr<const Shape>;

// Disjoint closed curves. k = 1.
ShapePtr Curves(std::vector<Curve> curves);
// Plane curves (rho, z), rho > 0, turned about the axis by a sphere S^m: S^1 x S^m each. A curve
// that is its own mirror image in the axis makes an S^(m+1). k = m + 1, d = m + 2.
ShapePtr Revolution(std::vector<Curve> profiles, bool symmetric, int m);
ShapePtr Product(ShapePtr a, ShapePtr b);
// Disjoint round spheres S^k in R^(k+1).
ShapePtr Spheres(int k, MatrixXd centres, std::vector<double> radii);
// Turned at random into R^d.
ShapePtr Placed(ShapePtr shape, int d, std::mt19937_64& random);

// What is not what it is declared to be; it has no right mesh.
ShapePtr WireAsCurve(double radius);     // a thin torus, told with one tangent
ShapePtr ShellAsSurface(double thick);   // what lies between two spheres, told with two tangents
ShapePtr SphereWithoutCap(double hole);  // a boundary: outside what is promised

Curve Circle(double x, double y, double radius);
// r(t) = sum_j radial[j] cos(j t), about (x, y).
Curve StarShaped(double x, double y, const std::vector<double>& radial);
// (p, q) torus knot, or a component of a torus link, `turn` being where it begins.
Curve TorusCurve(int p, int q, double tube, double turn = 0);

// The oracle of a shape: closest points, with tangents or without.
class ShapeOracle : public Oracle {
 public:
  ShapeOracle(ShapePtr shape, bool tangents, double box, bool seeds)
      : shape_(std::move(shape)), tangents_(tangents), box_(box), seeds_(seeds) {}

  int dimension() const override { return shape_->k(); }
  int ambient_dimension() const override { return shape_->d(); }
  Answer ClosestPoint(const MatrixXd& x) override;
  bool has_tangent_basis() const override { return tangents_; }
  std::optional<BoundingBox> bounding_box() const override;
  MatrixXd seeds() const override { return seeds_ ? shape_->Seeds() : MatrixXd(); }
  std::uint64_t asked() const { return asked_; }
  // The components that answers fell on, if it was told to note them.
  void NoteComponents() { notes_ = true; }
  const std::set<int>& components() const { return components_; }

 private:
  ShapePtr shape_;
  bool tangents_;
  double box_;
  bool seeds_;
  std::uint64_t asked_ = 0;
  bool notes_ = false;
  std::set<int> components_;
};

}  // namespace stellate::truth
