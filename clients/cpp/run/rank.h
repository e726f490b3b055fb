#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "stellate/oracle.h"

namespace stellate::client {

// Where the equations that M is given by lose rank.
struct Singular {
  Eigen::VectorXd place;  // a point of M next to it
  double ratio = 0;       // the Jacobian's least singular value there, of the median on M
};

// Follows the least singular value of the equations' Jacobian down along M, from where it is
// smallest. Nothing: they keep their rank, or there are none. Throws what the oracle throws.
//
// The server never sees equations, so that clients have this each: Python's is _rank.py. Both take
// their constants from clients/shared/equations.toml, and their tests' cases from singular.json
// there.
std::optional<Singular> FindSingular(Oracle& oracle, std::uint64_t random_seed);

}  // namespace stellate::client
