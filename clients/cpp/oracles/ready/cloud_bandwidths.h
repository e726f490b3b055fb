#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "oracles/ready/point_tree.h"

// How far the neighbours of each point of a cloud should reach, for quadrics to be fitted to them.
namespace stellate::oracles {

// Each point once, in the order in which they first come; of each given point, which it is.
struct DistinctPoints {
  explicit DistinctPoints(const Eigen::MatrixXd& points);

  std::vector<Eigen::Index> first, of;
};

// Of the quadrics at some points of the cloud.
struct CloudFits {
  std::vector<double> bend;        // their largest curvature
  std::vector<double> bend_error;  // what the noise makes of it, a standard deviation
};

// Of each point: twice the distance within which it, and those about it, have 2 k + 3 others. Scans
// that were put together have points several times, which are no others.
Eigen::VectorXd ByDensity(const Eigen::MatrixXd& points, const DistinctPoints& distinct,
                          Eigen::Index k);

// The bandwidths by density, wider where noise would make the surface bend more than it does. `fit`
// tells what quadrics of given bandwidths are like.
//
// The error of a curvature falls with the width w as w^-(2 + k/2), for there are w^k more points.
Eigen::VectorXd NoiseAware(const Eigen::VectorXd& widths, Eigen::Index k,
                           const std::function<CloudFits(const Eigen::VectorXd& widths)>& fit);

}  // namespace stellate::oracles
