#include "core/run/tangent_fits.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// Points within this many distances of the nearest k + 1 known ones count: in a lattice, where
// these are the nearest, those that share a facet of their Voronoi cells. Farther ones would add
// more of what is cubic than they take of other errors.
// On a curve the next but one count, too: two points would not do.
constexpr double Within(int k) { return k < 2 ? 2.6 : 1.6; }
// The same in distances of the nearest known one where there are not so many yet, around a seed.
constexpr double kAroundSeed = 2.1;
// The most that count, of known and of other points each: a lattice point has 2^(k+1) - 2
// neighbours.
constexpr int MostNear(int k) { return 2 << k; }
// Tangent spaces are estimates, positions exact: a slope counts this share of a position.
constexpr double kSlopeWeight = 0.5;
// The equations have to be so many times the coefficients.
constexpr double kLeastEquations = 1.15;
// Points nearer than this share of the others' distance say nothing of slopes.
constexpr double kLeastApart = 1e-3;
// Keeps the coefficients determined where points are on a conic; the terms are of order one. The
// cubic ones are of less.
constexpr double kFitRidge = 1e-6;
constexpr double kCubicFitRidge = 1e-4;
// Points are all around where their mean is nearer than this share of their distance, and there are
// so many times more equations than coefficients.
constexpr double kCentred = 0.25;
constexpr double kCubicEquations = 1.5;
// Each sweep takes two thirds of the error of what went before it.
constexpr int kRefiningSweeps = 3;

// Writes the terms of u, or their derivatives along an axis: linear, quadratic and, if they fit
// into the row, cubic.
void WriteTerms(const double* u, int k, double weight, Eigen::MatrixXd::RowXpr row) {
  Eigen::Index t = 0;
  for (int a = 0; a < k; ++a) row[t++] = weight * u[a];
  for (int a = 0; a < k; ++a)
    for (int b = a; b < k; ++b) row[t++] = weight * u[a] * u[b];
  if (t == row.size()) return;
  for (int a = 0; a < k; ++a)
    for (int b = a; b < k; ++b)
      for (int c = b; c < k; ++c) row[t++] = weight * u[a] * u[b] * u[c];
}

void WriteSlopes(const double* u, int k, int s, double weight, Eigen::MatrixXd::RowXpr row) {
  Eigen::Index t = 0;
  for (int a = 0; a < k; ++a) row[t++] = a == s ? weight : 0;
  for (int a = 0; a < k; ++a)
    for (int b = a; b < k; ++b) row[t++] = weight * ((a == s ? u[b] : 0) + (b == s ? u[a] : 0));
  if (t == row.size()) return;
  for (int a = 0; a < k; ++a)
    for (int b = a; b < k; ++b)
      for (int c = b; c < k; ++c)
        row[t++] = weight * ((a == s ? u[b] * u[c] : 0) + (b == s ? u[a] * u[c] : 0) +
                             (c == s ? u[a] * u[b] : 0));
}

}  // namespace

TangentFits::TangentFits(int k, int d) : k_(k), d_(d), known_(d) {}

void TangentFits::Know(const Eigen::MatrixXd& points, const Eigen::MatrixXd& tangents,
                       const Eigen::MatrixXd& normals, const std::vector<Knowledge>& known) {
  for (Eigen::Index c = 0; c < points.cols(); ++c) {
    const Knowledge is = known[static_cast<std::size_t>(c)];
    if (is == Knowledge::kNone) continue;
    is_exact_.push_back(is == Knowledge::kExact);
    known_.Add(points.col(c).data());
    tangents_.insert(tangents_.end(), tangents.col(c).begin(), tangents.col(c).end());
    normals_.insert(normals_.end(), normals.col(c).begin(), normals.col(c).end());
  }
}

void TangentFits::Look(const Eigen::MatrixXd& points) {
  looked_at_.emplace(d_);
  for (Eigen::Index c = 0; c < points.cols(); ++c) looked_at_->AddUnindexed(points.col(c).data());
  looked_at_->Index();
}

std::optional<TangentFits::Fit> TangentFits::At(Eigen::Index i, const double* guess) const {
  return FitAt(looked_at_->Point(static_cast<std::size_t>(i)), guess, &*looked_at_);
}

void TangentFits::Refine(const Eigen::MatrixXd& points, double most_misfit,
                         Eigen::MatrixXd* tangents) {
  looked_at_.reset();
  std::vector<double> next = tangents_;
  for (int sweep = 0; sweep < kRefiningSweeps; ++sweep) {
    ParallelFor(known_.size(), [&](std::size_t i) {
      if (is_exact_[i]) return;
      const std::optional<Fit> fit =
          FitAt(known_.Point(i), tangents_.data() + i * numbers(), nullptr);
      if (!fit || fit->misfit > most_misfit) return;
      const Eigen::Map<const Eigen::VectorXd> normal(
          normals_.data() + i * static_cast<std::size_t>(d_), d_);
      Eigen::Map<Eigen::MatrixXd>(next.data() + i * numbers(), d_, k_) = OrthonormalBasis(
          fit->tangents - normal * (normal.transpose() * fit->tangents).eval(), k_);
    });
    tangents_ = next;
  }
  ParallelFor(static_cast<std::size_t>(points.cols()), [&](std::size_t c) {
    const auto column = static_cast<Eigen::Index>(c);
    std::pair<double, std::uint32_t> nearest{1, 0};
    FindNearest(known_.tree(), points.col(column).data(), 1, &nearest);
    if (nearest.first == 0)
      std::copy_n(tangents_.data() + nearest.second * numbers(), numbers(),
                  tangents->col(column).data());
  });
}

TangentFits::Neighbourhood TangentFits::Around(const double* y,
                                               const IndexedPoints* looked_at) const {
  const int most = MostNear(k_);
  Neighbourhood near;
  near.known.resize(static_cast<std::size_t>(most));
  near.known.resize(
      static_cast<std::size_t>(FindNearest(known_.tree(), y, most, near.known.data())));
  std::erase_if(near.known, [](const auto& point) { return point.first == 0; });  // itself
  if (near.known.empty()) return near;
  const auto enough = static_cast<std::size_t>(k_);
  near.within = near.known.size() > enough ? Within(k_) * std::sqrt(near.known[enough].first)
                                           : std::max(kAroundSeed * std::sqrt(near.known[0].first),
                                                      std::sqrt(near.known.back().first));
  if (looked_at) {
    near.others.resize(static_cast<std::size_t>(most));
    near.others.resize(
        static_cast<std::size_t>(FindNearest(looked_at->tree(), y, most, near.others.data())));
  }
  const double most2 = near.within * near.within, least2 = kLeastApart * kLeastApart * most2;
  const auto is_out = [&](const auto& point) {
    return point.first > most2 || point.first < least2;
  };
  std::erase_if(near.known, is_out);
  std::erase_if(near.others, is_out);
  return near;
}

std::optional<TangentFits::Fit> TangentFits::FitAt(const double* y, const double* guess,
                                                   const IndexedPoints* looked_at) const {
  const Neighbourhood near = Around(y, looked_at);
  const std::vector<std::pair<double, std::uint32_t>>&known = near.known, &others = near.others;
  const double within = near.within;
  if (known.empty()) return std::nullopt;
  const auto rows =
      static_cast<Eigen::Index>(known.size() * static_cast<std::size_t>(k_ + 1) + others.size());
  const Eigen::Map<const Eigen::MatrixXd> at(y, d_, 1), frame(guess, d_, k_);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(k_);
  double distance = 0;
  const auto count = [&](const double* q) {
    const Eigen::VectorXd along =
        frame.transpose() * (Eigen::Map<const Eigen::VectorXd>(q, d_) - at);
    mean += along;
    distance += along.norm();
  };
  for (const auto& [distance2, id] : others) count(looked_at->Point(id));
  for (const auto& [distance2, id] : known) count(known_.Point(id));
  const int quadratic = k_ + k_ * (k_ + 1) / 2;
  const int cubic = quadratic + k_ * (k_ + 1) * (k_ + 2) / 6;
  Fit fit;
  fit.is_inside =
      static_cast<double>(rows) >= kCubicEquations * cubic && mean.norm() <= kCentred * distance;
  const int terms = fit.is_inside ? cubic : quadratic;
  if (static_cast<double>(rows) < kLeastEquations * terms) return std::nullopt;
  Eigen::MatrixXd left(rows, terms), right(rows, d_);
  Eigen::Index row = 0;
  Eigen::VectorXd u(k_), step(d_);
  const auto add_position = [&](const double* q) {
    step = Eigen::Map<const Eigen::VectorXd>(q, d_) - at;
    u = frame.transpose() * step;
    step -= frame * u;
    u /= within;
    const double weight = 1 / u.norm();
    WriteTerms(u.data(), k_, weight, left.row(row));
    right.row(row++) = weight / within * step.transpose();
  };
  for (const auto& [distance2, id] : others) add_position(looked_at->Point(id));
  for (const auto& [distance2, id] : known) {
    add_position(known_.Point(id));
    // The slopes of M there: T (F^t T)^-1 - F.
    const Eigen::Map<const Eigen::MatrixXd> tangent(tangents_.data() + id * numbers(), d_, k_);
    const Eigen::MatrixXd turned = frame.transpose() * tangent;
    const Eigen::MatrixXd slopes =
        SolveSymmetric(turned * turned.transpose(), turned * tangent.transpose()).transpose() -
        frame;
    for (int s = 0; s < k_; ++s) {
      WriteSlopes(u.data(), k_, s, kSlopeWeight, left.row(row));
      right.row(row++) = kSlopeWeight * slopes.col(s).transpose();
    }
  }
  Eigen::MatrixXd normal = left.transpose() * left;
  const double size = normal.trace() / terms;
  normal.diagonal().array() += kFitRidge * size;
  if (fit.is_inside) normal.diagonal().tail(cubic - quadratic).array() += kCubicFitRidge * size;
  const Eigen::MatrixXd coefficients = SolveSymmetric(normal, left.transpose() * right);
  const double freedom = static_cast<double>(rows - terms) / static_cast<double>(rows);
  fit.misfit = std::sqrt((left * coefficients - right).squaredNorm() /
                         (static_cast<double>(rows) * freedom));
  if (!std::isfinite(fit.misfit)) return std::nullopt;
  fit.tangents = OrthonormalBasis(frame + coefficients.topRows(k_).transpose(), k_);
  return fit;
}

}  // namespace stellate::core
