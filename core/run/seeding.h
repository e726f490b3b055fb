#pragma once

#include <Eigen/Core>
#include <string>

#include "core/specification.h"

namespace stellate::core {

// Returns the points whose closest points a run begins with, d x n: the client's seeds, or seeds
// that cover the box, or random points of it.
Eigen::MatrixXd SeedsOf(const Specification& spec);

// Explains that none of `count` seeds was found, for people.
std::string WhyNoSeeds(const Specification& spec, Eigen::Index count);

}  // namespace stellate::core
