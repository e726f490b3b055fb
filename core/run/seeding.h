#pragma once

#include <Eigen/Core>
#include <string>

#include "core/specification.h"

namespace stellate::core {

// The points whose closest points a run begins with, d x n: the client's seeds, or those that cover
// the box, or others drawn from it.
Eigen::MatrixXd SeedsOf(const Specification& spec);

// That none of `count` seeds was found, for people.
std::string WhyNoSeeds(const Specification& spec, Eigen::Index count);

}  // namespace stellate::core
