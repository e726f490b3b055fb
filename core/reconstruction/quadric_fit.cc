#include "core/reconstruction/quadric_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/base/dense.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// Weights and coordinates are scaled by a little more than the distance of the farthest neighbour.
constexpr double kScale = 1.1;
// exp(-1.5 t), t = |q - p|^2 / scale^2, as (1 - 1.5 t / 8)^8.
double Weight(double t) {
  const double base = 1 - 1.5 / 8 * t, square = base * base, fourth = square * square;
  return fourth * fourth;
}
// Added to the diagonal of normal equations, whose entries are near 1: points on a line or a conic
// leave coefficients open, which then become small.
constexpr double kRidge = 1e-9;
// A direction in which the points extend by less than this share of the largest, squared, is none
// of the manifold's.
constexpr double kExtends = 0.2;
constexpr double kDependent = 1e-8;  // of a row's length, what is left of it

struct Leading {
  Eigen::VectorXd values;   // ascending, all
  Eigen::MatrixXd vectors;  // columns
};

Leading EigenOf(const Eigen::MatrixXd& a) {
  if (a.rows() == 3) {  // most often
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver{Eigen::Matrix3d(a)};
    return {solver.eigenvalues(), solver.eigenvectors()};
  }
  SymmetricEigen eigen = EigenOfSymmetric(a);
  return {std::move(eigen.values), std::move(eigen.vectors)};
}

}  // namespace

void Orthonormalize(int k, int d, double* rows) {
  int axis = 0;
  for (int a = 0; a < k; ++a) {
    double* const u = rows + a * d;
    for (;;) {
      const double before = std::sqrt(Dot(u, u, d));
      for (int pass = 0; pass < 2; ++pass)
        for (int b = 0; b < a; ++b) {
          const double along = Dot(rows + b * d, u, d);
          for (int i = 0; i < d; ++i) u[i] -= along * rows[b * d + i];
        }
      const double length = std::sqrt(Dot(u, u, d));
      if (length > kDependent * before && length > 0) {
        for (int i = 0; i < d; ++i) u[i] /= length;
        break;
      }
      std::fill(u, u + d, 0.0);
      u[axis++] = 1;
    }
  }
}

void QuadricFit::Weigh(const double* points, Neighbours neighbours) {
  const auto m = static_cast<Eigen::Index>(neighbours.size());
  const auto stride = static_cast<std::size_t>(d_);
  const double* const p = points + neighbours[0].second * stride;
  radius2_ = kScale * neighbours.back().first;
  if (!(radius2_ > 0)) radius2_ = 1;  // so near to each other that squares vanish
  if (offsets_.cols() != m || offsets_.rows() != d_) offsets_.resize(d_, m);
  weights_.resize(m);
  for (Eigen::Index j = 0; j < m; ++j) {
    const auto& [distance2, id] = neighbours[static_cast<std::size_t>(j)];
    const double* const q = points + id * stride;
    double* const offset = offsets_.col(j).data();
    for (int i = 0; i < d_; ++i) offset[i] = q[i] - p[i];
    weights_[j] = Weight(distance2 / radius2_);
  }
}

// In large d the principal components come from the products of the m points.
void QuadricFit::FindPlane() {
  const Eigen::Index m = offsets_.cols();
  const Eigen::VectorXd mean = offsets_ * weights_ / weights_.sum();
  scaled_.noalias() = (offsets_.colwise() - mean) * weights_.cwiseSqrt().asDiagonal();
  const bool by_points = d_ > m;
  const Leading eigen = EigenOf(by_points ? Eigen::MatrixXd(scaled_.transpose() * scaled_)
                                          : Eigen::MatrixXd(scaled_ * scaled_.transpose()));
  const Eigen::Index count = eigen.values.size();
  for (int a = 0; a < k_; ++a) {
    const Eigen::Index at = count - 1 - a;
    Eigen::Map<Eigen::VectorXd> row(tangent_.data() + a * d_, d_);
    if (at < 0)
      row.setZero();
    else if (by_points)
      row = scaled_ * eigen.vectors.col(at);
    else
      row = eigen.vectors.col(at);
  }
  Orthonormalize(k_, d_, tangent_.data());
  extent_ = 0;
  for (Eigen::Index i = count - 1; i >= 0; --i)
    extent_ += eigen.values[i] >= kExtends * eigen.values[count - 1];
}

void QuadricFit::FitHeights(bool keep, Wanted wanted) {
  const Eigen::Index m = offsets_.cols();
  const bool quadric = m > Terms(k_);
  const Eigen::Index count = quadric ? Terms(k_) : m > k_ + 1 ? k_ + 1 : 1;
  const Eigen::Map<const Eigen::MatrixXd> tangent(tangent_.data(), d_, k_);
  const double scale = 1 / std::sqrt(radius2_);
  along_.noalias() = tangent.transpose() * offsets_;
  heights_.noalias() = offsets_ - tangent * along_;
  terms_.resize(count, m);
  for (Eigen::Index j = 0; j < m; ++j) {
    Eigen::Index row = 0;
    terms_(row++, j) = 1;
    for (int a = 0; a < k_ && row < count; ++a) terms_(row++, j) = scale * along_(a, j);
    for (int a = 0; a < k_ && row < count; ++a)
      for (int b = a; b < k_; ++b) terms_(row++, j) = scale * scale * along_(a, j) * along_(b, j);
  }
  weighted_.noalias() = terms_ * weights_.asDiagonal();
  normal_.noalias() = weighted_ * terms_.transpose();
  normal_.diagonal().array() += kRidge * weights_.sum();
  coefficients_.noalias() = weighted_ * heights_.transpose();
  normal_.llt().solveInPlace(coefficients_);
  step_ = coefficients_.row(0).transpose();
  if (!keep && count > k_) {
    Eigen::Map<Eigen::MatrixXd>(tangent_.data(), d_, k_) +=
        scale * coefficients_.middleRows(1, k_).transpose();
    Orthonormalize(k_, d_, tangent_.data());
  }
  if (wanted != Wanted::kQuadric) Deviate(wanted);
}

void QuadricFit::Deviate(Wanted wanted) {
  const Eigen::Index m = terms_.cols(), count = terms_.rows();
  residuals_.noalias() = heights_ - coefficients_.transpose() * terms_;
  const double freedom = static_cast<double>(m - count) / static_cast<double>(m);
  const double sum = residuals_.colwise().squaredNorm() * weights_;
  deviation_ = freedom > 0 ? std::sqrt(sum / (weights_.sum() * freedom * (d_ - k_))) : 0;
  if (wanted == Wanted::kAll) MeasureKurtosis();
}

void QuadricFit::MeasureKurtosis() {
  Eigen::Index longest = 0;
  residuals_.colwise().squaredNorm().maxCoeff(&longest);
  Eigen::VectorXd direction = residuals_.col(longest);
  constexpr int kSteps = 5;  // of the power method; one finds all of it in codimension 1
  for (int step = d_ - k_ > 1 ? kSteps : 0; step > 0; --step) {
    direction = residuals_ * (residuals_.transpose() * direction);
    const double length = direction.norm();
    if (!(length > 0)) break;
    direction /= length;
  }
  const Eigen::ArrayXd square = (residuals_.transpose() * direction).array().square();
  const double second = square.mean();
  kurtosis_ = second > 0 ? square.square().mean() / (second * second) : 0;
}

void QuadricFit::Fit(const double* points, Neighbours neighbours, const double* given,
                     Wanted wanted) {
  const auto numbers = static_cast<std::size_t>(k_) * static_cast<std::size_t>(d_);
  Weigh(points, neighbours);
  tangent_.resize(numbers);
  extent_ = 0;
  if (given)
    std::copy_n(given, numbers, tangent_.data());
  else
    FindPlane();
  FitHeights(given != nullptr, wanted);
}

}  // namespace stellate::core
