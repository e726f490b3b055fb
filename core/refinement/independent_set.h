#pragma once

#include <cstddef>
#include <vector>

#include "core/complex/stars.h"
#include "core/refinement/target.h"

namespace stellate::core {

// Returns the insertion points of targets, d each.
template <int K>
std::vector<double> CentresOf(const Stars<K>& stars, const std::vector<Target<K>>& targets);

// Chooses the targets of one round, by their places: a maximal set in which no insertion point
// (`centres`, d each) lies in the conflict ball of another (radius |x| for rules R1 and R2, 2|x|
// for R3 and R4), taken greedily by rule and then by descending |x|; the first `most` of it. Ties
// are broken by star, which is also the order that they are returned in: near ones are mostly
// together. The targets may come in any order, and from any number of parts of a sample, if their
// stars are named as in the whole.
template <int K>
std::vector<std::size_t> SelectIndependent(int d, const std::vector<double>& centres,
                                           const std::vector<Target<K>>& targets, std::size_t most);

}  // namespace stellate::core
