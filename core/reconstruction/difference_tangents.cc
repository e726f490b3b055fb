#include "core/reconstruction/difference_tangents.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/dense.h"
#include "core/base/infinity.h"
#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// Finds the number of neighbours that leaves the smallest bound, writes the tangent space and
// returns the bound.
double FindBest(const FittedCloud& cloud, std::uint32_t p, double* tangent) {
  const Eigen::Index d = cloud.d, k = cloud.k;
  const Eigen::Map<const Eigen::VectorXd> at(cloud.Position(p), d);
  const auto near = cloud.Near(p);
  const auto most = static_cast<Eigen::Index>(near.size()) - 1;
  Eigen::MatrixXd columns(d, most);
  std::vector<double> sums;  // of squared distances
  double sum = 0, best = kInfinity;
  for (Eigen::Index j = 0; j < most; ++j) {
    const std::uint32_t q = near[static_cast<std::size_t>(j) + 1];
    columns.col(j) = Eigen::Map<const Eigen::VectorXd>(cloud.Position(q), d) - at;
    const double length = columns.col(j).norm();
    columns.col(j) /= length;
    sum += length * length;
    sums.push_back(sum);
  }
  for (Eigen::Index m = std::min(2 * k, most); m <= most; m += k) {
    const SingularColumns singular = LeftSingular(columns.leftCols(m));
    if (singular.values.size() < k || singular.vectors.cols() < k) continue;
    const double least = singular.values[k - 1];
    const double bound = std::sqrt(sums[static_cast<std::size_t>(m) - 1]) / 2 / least;
    if (!(bound < best)) continue;
    best = bound;
    Eigen::Map<Eigen::MatrixXd>(tangent, d, k) = singular.vectors.leftCols(k);
  }
  return best;
}

}  // namespace

DifferenceTangents FindDifferenceTangents(const FittedCloud& cloud,
                                          const std::vector<std::uint8_t>& asked) {
  DifferenceTangents result;
  result.tangents = cloud.tangents;
  std::vector<double> bounds(cloud.size, 0.0);
  const auto numbers = static_cast<std::size_t>(cloud.k) * static_cast<std::size_t>(cloud.d);
  ParallelFor(cloud.size, [&](std::uint32_t p) {
    if (asked[p]) bounds[p] = FindBest(cloud, p, result.tangents.data() + p * numbers);
  });
  result.error_length = *std::max_element(bounds.begin(), bounds.end());
  return result;
}

}  // namespace stellate::core
