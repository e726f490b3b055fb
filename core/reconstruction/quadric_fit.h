#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace stellate::core {

// A point's neighbours as (squared distance, id), nearest first; the point itself is the first.
using Neighbours = std::span<const std::pair<double, std::uint32_t>>;

// Fits a quadric to the points around a point p: a k-plane by weighted principal components, and
// the heights over it as a quadratic polynomial of the coordinates in it, by weighted least
// squares. Weights fall off like a Gaussian. Keep one for many points: it reuses its memory.
//
//   QuadricFit fit(k, d);
//   fit.Fit(points, neighbours, nullptr, QuadricFit::Wanted::kQuadric);
//   fit.tangent();  // k rows of d, orthonormal
//
// The sums are in the order of the neighbours, so that equal neighbours give equal bits.
class QuadricFit {
 public:
  QuadricFit(int k, int d) : k_(k), d_(d) {}

  // What a fit is made for: the tangent space and the step; the deviation and the extent, too; and
  // all.
  enum class Wanted { kQuadric, kDeviation, kAll };

  // The coefficients of the polynomial: 1 + k + k (k + 1) / 2.
  static constexpr int Terms(int k) { return 1 + k + k * (k + 1) / 2; }

  // `points`: d each, by id. `given`: the tangent space at p, k rows of d, which then stays as it
  // is; null: it is fitted. With too few neighbours for a quadric, fits a plane. What is not wanted
  // keeps no meaning.
  void Fit(const double* points, Neighbours neighbours, const double* given,
           Wanted wanted = Wanted::kAll);

  // The tangent space at p.
  const std::vector<double>& tangent() const { return tangent_; }
  // From p to the quadric, straight over the plane: d numbers, a length each.
  const Eigen::VectorXd& step() const { return step_; }
  // The standard deviation of a coordinate from the quadric, length: the weighted residual, for its
  // degrees of freedom and d - k coordinates.
  double deviation() const { return deviation_; }
  // The kurtosis of the residuals along their principal direction: 3 if they are normal, 1.8 if
  // uniform, 1 if the points are on two sheets.
  double kurtosis() const { return kurtosis_; }
  // The number of directions in which the points extend alike; 0 where the tangent space was given.
  int extent() const { return extent_; }

 private:
  void Weigh(const double* points, Neighbours neighbours);
  void FindPlane();
  void FitHeights(bool keep, Wanted wanted);
  void Deviate(Wanted wanted);
  void MeasureKurtosis();

  int k_, d_;
  double radius2_ = 0;                // the scale of weights and coordinates, squared
  Eigen::MatrixXd offsets_;           // d x m, from p
  Eigen::VectorXd weights_;           // m
  Eigen::MatrixXd scaled_;            // d x m, offsets from the mean by the roots of the weights
  Eigen::MatrixXd along_;             // k x m, offsets along the plane
  Eigen::MatrixXd heights_;           // d x m, over it
  Eigen::MatrixXd terms_, weighted_;  // terms x m
  Eigen::MatrixXd normal_;            // terms x terms
  Eigen::MatrixXd coefficients_;      // terms x d
  Eigen::MatrixXd residuals_;         // d x m
  std::vector<double> tangent_;
  Eigen::VectorXd step_;
  double deviation_ = 0, kurtosis_ = 0;
  int extent_ = 0;
};

// Makes k rows of d numbers orthonormal; a row that depends on those before it is replaced by an
// axis that does not.
void Orthonormalize(int k, int d, double* rows);

}  // namespace stellate::core
