#pragma once

#include <Eigen/Dense>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "stellate/oracle.h"
#include "tests/truth/curves.h"

namespace stellate::truth {

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
  // How many there are whose every one some answer has to fall on.
  virtual int parts() const { return Betti().front(); }
  // Of manifolds with boundary, as oracles have it (stellate/oracle.h); no two walls meet.
  virtual int walls() const { return 0; }
  virtual VectorXd FacePoint(const VectorXd& x, int /*wall*/) const { return x; }
  virtual VectorXd Clearances(const VectorXd& /*x*/) const { return {}; }
  virtual VectorXd Conormal(const VectorXd& y, int /*wall*/) const { return y; }
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
// The unit ball of R^d without a smaller one: a domain whose skins are two walls, or one.
ShapePtr HollowBall(VectorXd centre, double radius, bool one_wall);
// Turned at random into R^d.
ShapePtr Placed(ShapePtr shape, int d, std::mt19937_64& random);

// What is not what it is declared to be; it has no right mesh.
ShapePtr WireAsCurve(double radius);     // a thin torus, told with one tangent
ShapePtr ShellAsSurface(double thick);   // what lies between two spheres, told with two tangents
ShapePtr SphereWithoutCap(double hole);  // a boundary: outside what is promised

// The oracle of a shape: closest points, with tangents or without.
class ShapeOracle : public Oracle {
 public:
  ShapeOracle(ShapePtr shape, bool tangents, double box, bool seeds)
      : shape_(std::move(shape)), tangents_(tangents), box_(box), seeds_(seeds) {}

  int dimension() const override { return shape_->k(); }
  int ambient_dimension() const override { return shape_->d(); }
  Answer ClosestPoint(const MatrixXd& x) override;
  bool has_tangent_basis() const override { return tangents_; }
  int walls() const override { return shape_->walls(); }
  Answer FacePoint(const MatrixXd& x, const Walls& face) override;
  MatrixXd Clearances(const MatrixXd& points) override;
  MatrixXd Conormals(const MatrixXd& points, const Walls& face) override;
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
