#include "oracles/ready/cloud_quadrics.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace stellate::oracles {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr double kLeastCurving = 0.2;  // of the distance, whose own is 1 where M is flat
// Neighbours that all but determine no quadric: a flat one is preferred, by a share of the weights
// that is far below what noise does.
constexpr double kFlat = 1e-10;
constexpr double kLeastFree = 0.1;  // of the neighbours, what their quadric leaves to the noise

// 1, s_a, and s_a s_b for a <= b, of each column.
void Monomials(const MatrixXd& s, MatrixXd* terms) {
  const Index k = s.rows();
  terms->resize(QuadricTerms(k), s.cols());
  terms->row(0).setOnes();
  terms->middleRows(1, k) = s;
  Index at = 1 + k;
  for (Index a = 0; a < k; ++a) {
    for (Index b = a; b < k; ++b) terms->row(at++) = s.row(a).cwiseProduct(s.row(b));
  }
}

// What the noise makes of a quadric's curvature, a standard deviation.
double BendError(const CloudFit& fit) {
  const Index terms = fit.terms.rows(), across = fit.heights.rows();
  const VectorXd off = (fit.heights - fit.solution.transpose() * fit.terms).colwise().squaredNorm();
  const double total = fit.weights.sum();
  // As many neighbours as the weights are worth, less the quadric's own freedom.
  const double worth = total * total / fit.weights.squaredNorm();
  const double free = std::max(1 - static_cast<double>(terms) / std::max(worth, 1.0), kLeastFree);
  const double noise = std::sqrt(fit.weights.dot(off) / total / free / static_cast<double>(across));
  const MatrixXd inverse = fit.system.inverse();
  const MatrixXd twice = fit.terms * fit.weights.cwiseAbs2().asDiagonal() * fit.terms.transpose();
  const MatrixXd errors = inverse * twice * inverse;
  const double pure =
      errors.diagonal().tail(terms - 1 - fit.along.cols()).sum() * static_cast<double>(across);
  return 2 * noise * std::sqrt(std::max(pure, 0.0)) / fit.scale;
}

}  // namespace

CloudQuadrics::CloudQuadrics(const MatrixXd& points, Index k) : points_(points), k_(k) {}

void CloudQuadrics::Reach(VectorXd bandwidths) {
  bandwidths_ = std::move(bandwidths);
  const double least = bandwidths_.minCoeff();
  std::map<double, std::vector<Index>> members;
  for (Index i = 0; i < bandwidths_.size(); ++i) {
    members[std::floor(2 * std::log2(bandwidths_[i] / least))].push_back(i);
  }
  octaves_.clear();
  octaves_.reserve(members.size());
  for (auto& [number, mine] : members) {
    auto tree = std::make_unique<const PointTree>(points_(Eigen::all, mine));
    const double reach = bandwidths_(mine).maxCoeff();
    octaves_.push_back({std::move(mine), std::move(tree), reach});
  }
}

std::vector<CloudQuadrics::Neighbour> CloudQuadrics::NeighboursOf(const VectorXd& place) const {
  std::vector<Neighbour> found;
  for (const HalfOctave& octave : octaves_) {
    for (const Index member : octave.tree->Within(place, octave.reach)) {
      const Index point = octave.members[static_cast<size_t>(member)];
      const double share = (points_.col(point) - place).norm() / bandwidths_[point];
      if (share >= 1) continue;
      const double u = 1 - share, square = u * u;
      found.push_back({point, square * square * (5 - 4 * u)});  // Wendland's, twice smooth
    }
  }
  // So that sums are the same, whichever trees points are in.
  std::sort(found.begin(), found.end(),
            [](const Neighbour& a, const Neighbour& b) { return a.point < b.point; });
  return found;
}

bool CloudQuadrics::Fit(const VectorXd& place, CloudFit* fit) const {
  const std::vector<Neighbour> near = NeighboursOf(place);
  const Index count = std::ssize(near), d = place.size();
  if (count < QuadricTerms(k_)) return false;
  MatrixXd away(d, count);
  fit->weights.resize(count);
  fit->scale = 0;
  for (Index i = 0; i < count; ++i) {
    const auto& [point, weight] = near[static_cast<size_t>(i)];
    away.col(i) = points_.col(point) - place;
    fit->weights[i] = weight;
    fit->scale += weight * bandwidths_[point];
  }
  const double total = std::max(fit->weights.sum(), 1e-300);
  fit->scale /= total;
  away /= fit->scale;
  const VectorXd middle = away * fit->weights / total;
  const MatrixXd spread =
      away * fit->weights.asDiagonal() * away.transpose() - total * middle * middle.transpose();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(spread);
  fit->along = axes.eigenvectors().rightCols(k_);
  fit->across = axes.eigenvectors().leftCols(d - k_);
  Monomials(fit->along.transpose() * away, &fit->terms);
  fit->heights.noalias() = fit->across.transpose() * away;
  const MatrixXd weighted = fit->terms * fit->weights.asDiagonal();
  fit->system.noalias() = weighted * fit->terms.transpose();
  fit->system.diagonal().array() += kFlat * total + 1e-300;
  fit->solution = fit->system.ldlt().solve(weighted * fit->heights.transpose());
  return fit->scale > 0 && fit->solution.allFinite();
}

CloudFits CloudQuadrics::FitsAt(Index stride) const {
  CloudFits fits;
  CloudFit fit;
  for (Index j = 0; j < points_.cols(); j += stride) {
    if (!Fit(points_.col(j), &fit)) continue;
    const double error = BendError(fit);
    if (!std::isfinite(error)) continue;
    fits.bend.push_back(2 * fit.solution.bottomRows(fit.solution.rows() - 1 - k_).norm() /
                        fit.scale);
    fits.bend_error.push_back(error);
  }
  return fits;
}

CloudQuadric CloudQuadrics::QuadricOf(const CloudFit& fit, const VectorXd& place) const {
  const MatrixXd slopes = fit.solution.middleRows(1, k_);
  const Eigen::HouseholderQR<MatrixXd> qr(fit.along + fit.across * slopes.transpose());
  return {place + fit.scale * (fit.across * fit.solution.row(0).transpose()),
          qr.householderQ() * MatrixXd::Identity(place.size(), k_)};
}

VectorXd CloudQuadrics::Towards(const CloudFit& fit, const CloudQuadric& quadric,
                                const VectorXd& x) const {
  const VectorXd gap = x - quadric.place;
  const MatrixXd turn = fit.along.transpose() * quadric.tangents;
  const VectorXd wish = turn * (quadric.tangents.transpose() * gap);
  // Second derivatives of the heights over the plane, times how far x is above it.
  const VectorXd bends =
      fit.solution.bottomRows(k_ * (k_ + 1) / 2) * (fit.across.transpose() * gap) / fit.scale;
  MatrixXd hessian = MatrixXd::Identity(k_, k_);
  Index at = 0;
  for (Index a = 0; a < k_; ++a) {
    hessian(a, a) -= 2 * bends[at++];
    for (Index b = a + 1; b < k_; ++b, ++at) {
      hessian(a, b) -= bends[at];
      hessian(b, a) -= bends[at];
    }
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(hessian);
  const VectorXd shares = (axes.eigenvectors().transpose() * wish).array() /
                          axes.eigenvalues().array().abs().max(kLeastCurving);
  return quadric.tangents * (turn.transpose() * (axes.eigenvectors() * shares));
}

}  // namespace stellate::oracles
