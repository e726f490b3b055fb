#include "oracles/ready/cloud_bandwidths.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oracles/combined/common.h"

namespace stellate::oracles {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr int kRounds = 12;  // of bandwidths from noise, and noise from fits of these bandwidths
constexpr double kSettled = 0.02;  // a share: no round that changes them by less has another
// Of the curvature, what noise may make of it: tangents and reach are as good then as of exact
// points.
constexpr double kNoiseShare = 0.1;
constexpr double kLeast = 0.1;  // of the curvature that is seen: no less is left of it by the noise
constexpr double kGrowth = 1.5;  // of a bandwidth in a round
constexpr double kWidest = 0.5;  // of the least radius of curvature: a quadric follows no more

double MedianOf(const VectorXd& values) { return Quantile({values.begin(), values.end()}, 0.5); }

// What is left of the curvatures that are seen without so many deviations of what noise adds.
std::vector<double> Without(const CloudFits& seen, double deviations) {
  std::vector<double> left(seen.bend.size());
  for (size_t i = 0; i < left.size(); ++i) {
    const double error = deviations * seen.bend_error[i];
    left[i] = std::sqrt(std::max(seen.bend[i] * seen.bend[i] - error * error, 0.0));
  }
  return left;
}

}  // namespace

DistinctPoints::DistinctPoints(const MatrixXd& points) : of(static_cast<size_t>(points.cols())) {
  std::vector<Index> order(of.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&points](Index i, Index j) {
    const auto [mine, its] =
        std::mismatch(points.col(i).begin(), points.col(i).end(), points.col(j).begin());
    return mine == points.col(i).end() ? i < j : *mine < *its;
  });
  std::vector<Index> leader(of.size());
  for (size_t a = 0; a < order.size(); ++a) {
    const bool repeats = a > 0 && points.col(order[a]) == points.col(order[a - 1]);
    leader[static_cast<size_t>(order[a])] =
        repeats ? leader[static_cast<size_t>(order[a - 1])] : order[a];
  }
  for (size_t i = 0; i < of.size(); ++i) {
    const auto its = static_cast<size_t>(leader[i]);
    if (its == i) {
      of[i] = std::ssize(first);
      first.push_back(static_cast<Index>(i));
    } else {
      of[i] = of[its];
    }
  }
}

VectorXd ByDensity(const MatrixXd& points, const DistinctPoints& distinct, Index k) {
  const PointTree tree(points(Eigen::all, distinct.first));
  const Index count = tree.points().cols();
  VectorXd away(count);
  std::vector<std::vector<Index>> near(static_cast<size_t>(count));
  std::vector<double> distances;
  for (Index j = 0; j < count; ++j) {
    near[static_cast<size_t>(j)] = tree.Nearest(tree.points().col(j), 2 * k + 4, &distances);
    away[j] = distances.back();
  }
  VectorXd widths(points.cols());
  for (Index i = 0; i < widths.size(); ++i) {
    const auto which = static_cast<size_t>(distinct.of[static_cast<size_t>(i)]);
    widths[i] = 2 * away(near[which]).maxCoeff();
  }
  return widths;
}

VectorXd NoiseAware(const VectorXd& widths, Index k,
                    const std::function<CloudFits(const VectorXd& widths)>& fit) {
  VectorXd wider = widths;
  const double fall = 2 + static_cast<double>(k) / 2;
  const double usual_width = MedianOf(widths);
  for (int round = 0; round < kRounds; ++round) {
    const CloudFits seen = fit(wider);
    if (seen.bend.empty()) break;  // nowhere are neighbours enough
    const double bend =
        std::max({Quantile(Without(seen, 1), 0.5), kLeast * Quantile(seen.bend, 0.5), 1e-300});
    // What the error is at each point: as of the usual one, but for how many neighbours it has.
    const double relative = Quantile(seen.bend_error, 0.5) / (kNoiseShare * bend);
    const double usual = MedianOf(wider);
    // What is bent more than the noise can have made it, by two deviations.
    const double widest = kWidest / std::max(Quantile(Without(seen, 2), 0.9), bend);
    double change = 0;
    for (Index i = 0; i < wider.size(); ++i) {
      const double share = usual / wider[i];
      const double at = relative * share * share *
                        std::pow(share * widths[i] / usual_width, static_cast<double>(k) / 2);
      const double wished = std::max(wider[i] * std::pow(at, 1 / fall), widths[i]);
      const double allowed = std::max(std::min({wished, kGrowth * wider[i], widest}), widths[i]);
      change = std::max(change, std::abs(allowed / wider[i] - 1));
      wider[i] = allowed;
    }
    if (change < kSettled) break;
  }
  return wider;
}

}  // namespace stellate::oracles
