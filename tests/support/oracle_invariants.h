#pragma once

#include <gtest/gtest.h>

#include <cstdint>

#include "stellate/oracle.h"

namespace stellate::testing {

struct InvariantOptions {
  std::uint64_t random_seed = 1;
  int samples = 60;  // points of M that the laws are tried on
  // How far from M, as a length, closest points are surely unique. Half the reach is a good choice.
  double clearance = 0.1;
  // Allowed error of a point or of a tangent's entry, relative to the size of M.
  double tolerance = 1e-9;
};

// The laws that every oracle must keep, whatever its manifold:
//  - a closest point is its own closest point, and no other point seen of M is nearer;
//  - a tangent basis is orthonormal, and spans the image of the closest point map's derivative;
//  - x - closest_point(x) is normal to M at the closest point;
//  - an intersection lies in M, in the flat, within the radius; and it is found where M nearby is
//    known to meet the flat;
//  - one query a batch or many: the same answers.
// Points are found from the box or the seeds. The random seed is part of any failure's message.
::testing::AssertionResult OracleInvariantsHold(Oracle& oracle, const InvariantOptions& options);

}  // namespace stellate::testing
