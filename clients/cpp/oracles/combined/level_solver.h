#pragma once

#include <Eigen/Core>
#include <functional>

#include "stellate/oracle.h"

namespace stellate::oracles {

// A level set {y in M : f(y) = 0} of a manifold M with tangent bases.
struct Level {
  std::function<Eigen::VectorXd(const Eigen::VectorXd& x)> f;       // d -> m
  std::function<Eigen::MatrixXd(const Eigen::VectorXd& x)> slopes;  // d -> m x d
  double scale;                                                     // of where M is
};

// Nearest points of the level set to each column of x: down to the level and along it towards x, in
// M's tangent space, and back to M, again and again; a step is halved while it oversteps.
Answer OntoLevel(Oracle& manifold, const Level& level, const Eigen::MatrixXd& x);

}  // namespace stellate::oracles
