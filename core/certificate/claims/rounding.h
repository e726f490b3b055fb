#pragma once

#include <Eigen/Core>

namespace stellate::core {

// How far points may lie from those that they stand for, because their coordinates were rounded to
// single precision or to few decimals: a length, 0 where neither is seen. An oracle that rounds
// gives a rounded point for itself, so that asking again shows nothing of it. What would be more
// than `most` (a length) is no rounding: such points are short by nature, those of a grid, say.
double RoundingOf(const Eigen::MatrixXd& points, double most);

}  // namespace stellate::core
