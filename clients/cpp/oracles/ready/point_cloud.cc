#include <cmath>
#include <cstdio>
#include <limits>

#include "oracles/combined/common.h"
#include "oracles/ready/cloud_quadrics.h"
#include "oracles/ready/point_tree.h"
#include "stellate/oracles/points.h"

namespace stellate::oracles {
namespace {

constexpr int kMaxMoves = 100;
constexpr double kShortestMove = 1e-11;                                    // a step, in bandwidths
constexpr double kRoundings = 8 * std::numeric_limits<double>::epsilon();  // a step, in coordinates
constexpr double kLongestMove = 0.5;     // of one step, in bandwidths
constexpr Eigen::Index kFitLooks = 400;  // points at which fits are looked at, for the bandwidths
constexpr Eigen::Index kResidualPoints = 500;

// The step through so many points that takes about `looks` of them.
Eigen::Index Stride(Eigen::Index points, Eigen::Index looks) {
  return std::max<Eigen::Index>(1, points / looks);
}

std::string Digits(double number, int digits) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*g", digits, number);
  return text;
}

}  // namespace

class PointCloud::Neighbourhoods {
 public:
  Neighbourhoods(Eigen::MatrixXd points, int dimension, std::optional<double> bandwidth)
      : tree_(Checked(std::move(points), dimension)), quadrics_(tree_.points(), dimension) {
    if (bandwidth && !(std::isfinite(*bandwidth) && *bandwidth > 0)) {
      Refuse("bandwidth has to be positive, and is " + Short(*bandwidth));
    }
    const DistinctPoints distinct(tree_.points());
    InsistOnEnough(std::ssize(distinct.first), dimension);
    if (bandwidth) {
      quadrics_.Reach(Eigen::VectorXd::Constant(tree_.points().cols(), *bandwidth));
      return;
    }
    const Eigen::Index stride = Stride(tree_.points().cols(), kFitLooks);
    quadrics_.Reach(NoiseAware(ByDensity(tree_.points(), distinct, dimension), dimension,
                               [this, stride](const Eigen::VectorXd& widths) {
                                 quadrics_.Reach(widths);
                                 return quadrics_.FitsAt(stride);
                               }));
  }

  const Eigen::MatrixXd& points() const { return tree_.points(); }
  const Eigen::VectorXd& bandwidths() const { return quadrics_.bandwidths(); }

  // To where the quadric about a place goes through it, and the way to x is normal to it.
  bool Project(const Eigen::VectorXd& x, Eigen::VectorXd& y, Eigen::MatrixXd& tangents) const {
    const Eigen::Index nearest = tree_.Nearest(x, 1).front();
    const double reach = bandwidths()[nearest], longest = kLongestMove * reach;
    y = points().col(nearest);
    CloudFit fit;
    for (int i = 0; i < kMaxMoves; ++i) {
      if (!quadrics_.Fit(y, &fit)) return false;
      const CloudQuadric quadric = quadrics_.QuadricOf(fit, y);
      Eigen::VectorXd step = quadrics_.Towards(fit, quadric, x);
      step *= longest / std::max(step.norm(), longest);
      const Eigen::VectorXd there = quadric.place + step;
      if (!there.allFinite()) return false;
      // Far from the origin, as maps have them, coordinates are rounded more coarsely than that.
      const double rounded = kRoundings * there.lpNorm<Eigen::Infinity>();
      const bool arrived = (there - y).norm() <= std::max(kShortestMove * reach, rounded);
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
    return points;
  }

  static void InsistOnEnough(Eigen::Index distinct, int k) {
    if (distinct > 2 * QuadricTerms(k)) return;
    Refuse(std::to_string(distinct) + " different points are too few, at least " +
           std::to_string(2 * QuadricTerms(k) + 1) + " are needed: a quadric has " +
           std::to_string(QuadricTerms(k)) + " coefficients in each direction");
  }

  const PointTree tree_;
  CloudQuadrics quadrics_;
};

PointCloud::PointCloud(Eigen::MatrixXd points, int dimension, std::optional<double> bandwidth)
    : PointwiseOracle(dimension, static_cast<int>(points.rows())),
      around_(std::make_unique<const Neighbourhoods>(std::move(points), dimension, bandwidth)) {
  const Eigen::VectorXd& widths = around_->bandwidths();
  bandwidth_ = Quantile({widths.begin(), widths.end()}, 0.5);
  const Eigen::MatrixXd& all = around_->points();
  const Eigen::Index stride = Stride(all.cols(), kResidualPoints);
  std::vector<double> off;
  Eigen::VectorXd y;
  Eigen::MatrixXd tangents;
  for (Eigen::Index j = 0; j < all.cols(); j += stride) {
    if (around_->Project(all.col(j), y, tangents)) off.push_back((y - all.col(j)).norm());
  }
  if (off.empty()) {
    Refuse("no point has enough neighbours within " + Short(bandwidth_) + ": a larger bandwidth?");
  }
  residual_ = Quantile(std::move(off), 0.95);
}

PointCloud::~PointCloud() = default;

const Eigen::VectorXd& PointCloud::bandwidths() const { return around_->bandwidths(); }

std::optional<BoundingBox> PointCloud::bounding_box() const {
  return BoxAround(around_->points(), 0.02);
}

std::string PointCloud::about() const {
  const double low = bandwidths().minCoeff(), high = bandwidths().maxCoeff();
  const std::string local =
      low < high ? " (" + Digits(low, 3) + " to " + Digits(high, 3) + ")" : "";
  return std::to_string(bandwidths().size()) + " points of R^" +
         std::to_string(ambient_dimension()) + ", dimension " + std::to_string(dimension()) +
         ", bandwidth " + Digits(bandwidth_, 3) + local + ", residual " + Digits(residual_, 2);
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
