#pragma once

#include <Eigen/Dense>
#include <vector>

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
  Curve Mirrored() const;  // its first coordinate negated

 private:
  VectorXd Derivative(double t, int order) const;

  MatrixXd cosines_, sines_, samples_;
};

Curve Circle(double x, double y, double radius);
// r(t) = sum_j radial[j] cos(j t), about (x, y).
Curve StarShaped(double x, double y, const std::vector<double>& radial);
// (p, q) torus knot, or a component of a torus link, `turn` being where it begins.
Curve TorusCurve(int p, int q, double tube, double turn = 0);

// Of disjoint curves together, their reach: the least |q - p|^2 / (2 dist(q, T_p)) of two points.
double ReachOf(const std::vector<Curve>& curves);
// Of a ball about the origin that holds them, with a little room.
double RadiusOf(const std::vector<Curve>& curves);
// The curve that has a point nearest to x, and its parameter there.
const Curve* NearestOf(const std::vector<Curve>& curves, const VectorXd& x, double* t);

}  // namespace stellate::truth
