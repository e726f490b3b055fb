#pragma once

#include <Eigen/Core>
#include <string>

#include "core/refinement/candidate_set.h"
#include "core/specification.h"

namespace stellate::core {

// Returns the points whose closest points a run begins with, d x n: the client's seeds, or seeds
// that cover the box, or random points of it.
Eigen::MatrixXd SeedsOf(const Specification& spec);

// Explains that no seed was found, or no tangent space at one, for people.
std::string WhyNoSeeds(const Specification& spec, const AnsweredPoints& answers);

// Explains, for a manifold with boundary, that no seed's closest point is in M, for people: no
// point was found, or the box lies beside M, or the walls leave nothing of M^.
std::string WhyNothingInside(const Specification& spec, const AnsweredPoints& answers);

}  // namespace stellate::core
