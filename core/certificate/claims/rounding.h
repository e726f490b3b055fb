#pragma once

#include <Eigen/Core>

namespace stellate::core {

// Returns by how much the coordinates of `points` seem rounded, to single precision or to few
// decimals: the largest distance from the exact points, a length; 0 if neither is seen. A repeated
// query does not show this: an oracle that rounds answers a rounded point by itself. An error above
// `most` (a length) is not taken for rounding: such points, a grid's for instance, have few digits
// by nature.
double RoundingOf(const Eigen::MatrixXd& points, double most);

}  // namespace stellate::core
