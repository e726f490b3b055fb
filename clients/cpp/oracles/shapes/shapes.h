#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "stellate/pointwise.h"

// The manifolds of the catalogue, each in the smallest space it lives in.
namespace stellate::shapes {

// Unit k-sphere about the origin of R^(k+1). Reach 1.
std::unique_ptr<PointwiseOracle> Sphere(int k);
// Two unit spheres of R^3 with centres (-1.5, 0, 0) and (1.5, 0, 0). Reach 0.5.
std::unique_ptr<PointwiseOracle> TwoSpheres();
// Product of circles of the given radii, in R^(2k). Reach: the smallest radius.
std::unique_ptr<PointwiseOracle> Circles(std::vector<double> radii);
// { sum (x_i / a_i)^2 = 1 } in R^m for m >= 2 semi-axes. Reach: min a_i^2 / max a_i.
std::unique_ptr<PointwiseOracle> Ellipsoid(const std::vector<double>& axes);
// Torus about the z axis: tube of radius r about a circle of radius R > r. Reach min(r, R - r).
std::unique_ptr<PointwiseOracle> Torus(double R, double r);
// x^4 - 5x^2 + y^4 - 5y^2 + z^4 - 5z^2 + 11.8 = 0, genus 5.
std::unique_ptr<PointwiseOracle> Tanglecube();
// ((2 + cos qt) cos pt, (2 + cos qt) sin pt, sin qt), p and q coprime.
std::unique_ptr<PointwiseOracle> TorusKnot(int p, int q);
// Rotation matrices, row by row, in R^9 with the Frobenius metric. Reach sqrt 2.
std::unique_ptr<PointwiseOracle> Rotations3();
// The projective plane as the matrices v v^T, |v| = 1: (s11, s22, s33, sqrt2 s12, sqrt2 s13,
// sqrt2 s23) in R^6, or coordinates of its trace-free part in R^5. Reach 1/sqrt 2.
std::unique_ptr<PointwiseOracle> ProjectivePlane(int ambient_dimension);

// Of Newton's method between bounds: far more steps than doubles can need.
inline constexpr int kMaxIterations = 100;

// tangent (m x (m-1)) := an orthonormal basis of the complement of the unit vector n.
void ComplementOf(const Eigen::VectorXd& n, Eigen::MatrixXd& tangent);

}  // namespace stellate::shapes
