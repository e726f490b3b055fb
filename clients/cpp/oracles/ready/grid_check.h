#pragma once

#include <Eigen/Core>
#include <vector>

#include "stellate/oracle.h"

namespace stellate::oracles {

// Values on a grid of a box, as SignedDistance::OfGrid has them, checked by GridSpline.
struct GridValues {
  const Eigen::VectorXd& values;
  const std::vector<int>& shape;
  const BoundingBox& box;
};

// There is a surface of the level, which is no stairs as labels and masks make, and does not leave
// the grid unless the border is open. Throws std::invalid_argument, saying what to do.
//
// Returns 1, or -1 where values are less than the level at the border.
double InsistOnASurface(const GridValues& grid, double level, bool open_border);

// The values with some more on all sides, as what they do at the border goes straight on; and their
// box.
struct WiderGrid {
  Eigen::VectorXd values;
  std::vector<int> shape;
  BoundingBox box;
};
WiderGrid GoneOnStraight(const GridValues& grid);

}  // namespace stellate::oracles
