#pragma once

#include <Eigen/Core>
#include <string>

#include "core/refinement/candidate_set.h"
#include "core/specification.h"

namespace stellate::core {

// Returns the points whose closest points a run begins with, d x n: the client's seeds, or seeds
// that cover the box, or random points of it.
Eigen::MatrixXd SeedsOf(const Specification& spec);

// Explains that none of `count` seeds was found, for people.
std::string WhyNoSeeds(const Specification& spec, Eigen::Index count);

// Of a manifold with boundary, that no seed's closest point is in it, for people: there is none, or
// the box lies beside M, or walls leave nothing of it.
std::string WhyNothingInside(const Specification& spec, const AnsweredPoints& answers);

}  // namespace stellate::core
