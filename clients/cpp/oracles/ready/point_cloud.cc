#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <cmath>

#include "oracles/ready/common.h"
#include "oracles/ready/point_tree.h"
#include "stellate/oracles/points.h"

namespace stellate::oracles {
namespace {

constexpr int kMaxMoves = 100;
constexpr double kShortestMove = 1e-11;  // a step, in bandwidths
constexpr double kLongestMove = 0.5;     // of one step, likewise
constexpr double kLeastCurving = 0.2;    // of the distance, whose own is 1 where M is flat
// Neighbours that all but determine no quadric: a flat one is preferred, by a share of the weights
// that is far below what noise does.
constexpr double kFlat = 1e-10;
constexpr Eigen::Index kBandwidthPoints = 2000, kResidualPoints = 500;  // looked at for these

Eigen::Index Terms(Eigen::Index k) { return 1 + k + k * (k + 1) / 2; }

// A surface of second order over a plane, at one place.
struct Quadric {
  Eigen::VectorXd place;          // d, on it
  Eigen::MatrixXd tangents;       // d x k, there
  Eigen::MatrixXd along, across;  // d x k, the plane; d x (d - k)
  Eigen::MatrixXd coefficients;   // terms x (d - k), of the heights across, in bandwidths
};

}  // namespace

class PointCloud::Neighbourhoods {
 public:
  Neighbourhoods(Eigen::MatrixXd points, int dimension, std::optional<double> bandwidth)
      : tree_(Checked(std::move(points), dimension)), k_(dimension) {
    bandwidth_ = bandwidth ? *bandwidth : Usual();
    if (!std::isfinite(bandwidth_) || bandwidth_ <= 0) {
      Refuse("bandwidth has to be positive, and is " + Short(bandwidth_));
    }
  }

  const Eigen::MatrixXd& points() const { return tree_.points(); }
  double bandwidth() const { return bandwidth_; }

  // To where the quadric about a place goes through it, and the way to x is normal to it.
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y, Eigen::MatrixXd& tangents) const {
    y = points().col(tree_.Nearest(x, 1).front());
    Quadric quadric;
    for (int i = 0; i < kMaxMoves; ++i) {
      if (!Fit(y, &quadric)) return false;
      Eigen::VectorXd step = Towards(quadric, x);
      step *= std::min(1.0, kLongestMove * bandwidth_ / std::max(step.norm(), 1e-300));
      const Eigen::VectorXd there = quadric.place + step;
      const bool arrived = (there - y).norm() <= kShortestMove * bandwidth_;
      y = there;
      tangents = quadric.tangents;
      if (arrived) return true;
    }
    return false;
  }

 private:
  static Eigen::MatrixXd Checked(Eigen::MatrixXd points, int k) {
    CheckPoints(points, "points");
    if (k < 1 || k >= points.rows()) {
      Refuse("dimension has to be a whole number from 1 to " + std::to_string(points.rows() - 1) +
             ": " + std::to_string(k));
    }
    if (points.cols() <= 2 * Terms(k)) {
      Refuse(std::to_string(points.cols()) + " points are too few: a quadric has " +
             std::to_string(Terms(k)) + " coefficients in each direction");
    }
    return points;
  }

  double Usual() const {
    const Eigen::Index stride = std::max<Eigen::Index>(1, points().cols() / kBandwidthPoints);
    std::vector<double> reaches, distances;
    for (Eigen::Index j = 0; j < points().cols(); j += stride) {
      tree_.Nearest(points().col(j), 2 * k_ + 4, &distances);
      reaches.push_back(distances.back());
    }
    return 2 * Quantile(std::move(reaches), 0.95);
  }

  // 1, s_a, and s_a s_b for a <= b.
  void Monomials(const Eigen::VectorXd& s, Eigen::VectorXd* terms) const {
    (*terms)[0] = 1;
    terms->segment(1, k_) = s;
    Eigen::Index at = 1 + k_;
    for (Eigen::Index a = 0; a < k_; ++a) {
      for (Eigen::Index b = a; b < k_; ++b) (*terms)[at++] = s[a] * s[b];
    }
  }

  // The least-squares quadric about a place, over the plane through its neighbours. False where
  // these are too few.
  bool Fit(const Eigen::VectorXd& place, Quadric* quadric) const {
    const std::vector<Eigen::Index> near = tree_.Within(place, bandwidth_);
    const auto count = std::ssize(near);
    if (count < Terms(k_)) return false;
    Eigen::MatrixXd away(place.size(), count);
    Eigen::VectorXd weights(count);
    for (Eigen::Index i = 0; i < count; ++i) {
      away.col(i) = (points().col(near[static_cast<size_t>(i)]) - place) / bandwidth_;
      const double share = away.col(i).norm(), rest = std::max(0.0, 1 - share);
      weights[i] = rest * rest * rest * rest * (4 * share + 1);  // Wendland's, twice smooth
    }
    const double total = std::max(weights.sum(), 1e-300);
    const Eigen::VectorXd middle = away * weights / total;
    const Eigen::MatrixXd spread =
        away * weights.asDiagonal() * away.transpose() - total * middle * middle.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(spread);
    quadric->along = axes.eigenvectors().rightCols(k_);
    quadric->across = axes.eigenvectors().leftCols(place.size() - k_);
    Solve(away, weights, total, quadric);
    const Eigen::MatrixXd slopes = quadric->coefficients.middleRows(1, k_);
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(quadric->along +
                                                   quadric->across * slopes.transpose());
    quadric->tangents = qr.householderQ() * Eigen::MatrixXd::Identity(place.size(), k_);
    quadric->place =
        place + bandwidth_ * (quadric->across * quadric->coefficients.row(0).transpose());
    return quadric->place.allFinite() && quadric->tangents.allFinite();
  }

  void Solve(const Eigen::MatrixXd& away, const Eigen::VectorXd& weights, double total,
             Quadric* quadric) const {
    const Eigen::Index size = Terms(k_);
    Eigen::MatrixXd system = (kFlat * total + 1e-300) * Eigen::MatrixXd::Identity(size, size);
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(size, quadric->across.cols());
    Eigen::VectorXd terms(size);
    for (Eigen::Index i = 0; i < away.cols(); ++i) {
      Monomials(quadric->along.transpose() * away.col(i), &terms);
      system.noalias() += weights[i] * terms * terms.transpose();
      right.noalias() +=
          weights[i] * terms * (quadric->across.transpose() * away.col(i)).transpose();
    }
    quadric->coefficients = system.ldlt().solve(right);
  }

  // The tangent step towards the point nearest to x: Newton's, downhill in any case.
  Eigen::VectorXd Towards(const Quadric& quadric, const Eigen::VectorXd& x) const {
    const Eigen::VectorXd gap = x - quadric.place;
    const Eigen::MatrixXd turn = quadric.along.transpose() * quadric.tangents;
    const Eigen::VectorXd wish = turn * (quadric.tangents.transpose() * gap);
    // Second derivatives of the heights over the plane, times how far x is above it.
    const Eigen::VectorXd bends = quadric.coefficients.bottomRows(k_ * (k_ + 1) / 2) *
                                  (quadric.across.transpose() * gap) / bandwidth_;
    Eigen::MatrixXd hessian = Eigen::MatrixXd::Identity(k_, k_);
    Eigen::Index at = 0;
    for (Eigen::Index a = 0; a < k_; ++a) {
      hessian(a, a) -= 2 * bends[at++];
      for (Eigen::Index b = a + 1; b < k_; ++b, ++at) {
        hessian(a, b) -= bends[at];
        hessian(b, a) -= bends[at];
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(hessian);
    const Eigen::VectorXd shares = (axes.eigenvectors().transpose() * wish).array() /
                                   axes.eigenvalues().array().abs().max(kLeastCurving);
    return quadric.tangents * (turn.transpose() * (axes.eigenvectors() * shares));
  }

  const PointTree tree_;
  const Eigen::Index k_;
  double bandwidth_ = 0;
};

PointCloud::PointCloud(Eigen::MatrixXd points, int dimension, std::optional<double> bandwidth)
    : PointwiseOracle(dimension, static_cast<int>(points.rows())),
      around_(std::make_unique<const Neighbourhoods>(std::move(points), dimension, bandwidth)) {
  const Eigen::MatrixXd& all = around_->points();
  const Eigen::Index stride = std::max<Eigen::Index>(1, all.cols() / kResidualPoints);
  std::vector<double> off;
  Eigen::VectorXd y;
  Eigen::MatrixXd tangents;
  for (Eigen::Index j = 0; j < all.cols(); j += stride) {
    if (around_->Project(all.col(j), y, tangents)) off.push_back((y - all.col(j)).norm());
  }
  if (off.empty()) {
    Refuse("no point has enough neighbours within " + Short(around_->bandwidth()) +
           ": a larger bandwidth?");
  }
  residual_ = Quantile(std::move(off), 0.95);
}

PointCloud::~PointCloud() = default;

double PointCloud::bandwidth() const { return around_->bandwidth(); }

std::optional<BoundingBox> PointCloud::bounding_box() const {
  return BoxAround(around_->points(), 0.02);
}

bool PointCloud::Project(const Eigen::VectorXd& x, Eigen::VectorXd& y) const {
  Eigen::MatrixXd tangents;
  return around_->Project(x, y, tangents);
}

void PointCloud::Tangent(const Eigen::VectorXd& y, Eigen::MatrixXd& tangent) const {
  Eigen::VectorXd again;
  if (!around_->Project(y, again, tangent)) {
    tangent = Eigen::MatrixXd::Identity(ambient_dimension(), dimension());
  }
}

}  // namespace stellate::oracles
