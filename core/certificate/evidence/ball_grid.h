#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/vector_ops.h"

namespace stellate::core {

// Finds the balls that contain a point: a few hundred balls in R^d, and all vertices of a large
// mesh as points. The balls are sorted into a grid over the coordinates in which their centres
// spread most, so that one look-up decides for most points that no ball contains them. Const
// queries may run in parallel.
//
//   BallGrid grid(d, centres, radii);
//   grid.ForEachAround(q, [](std::uint32_t ball, double distance2) { ... });
class BallGrid {
 public:
  // `centres`: d each, C order; borrowed.
  BallGrid(int d, const double* centres, std::vector<double> radii);

  // Calls visit(i, |q - centre i|^2) for each ball with |q - centre i| < radius i, by ascending i.
  template <typename Visit>
  void ForEachAround(const double* q, const Visit& visit) const {
    std::size_t cell = 0;
    for (const Axis& axis : axes_) {
      const double place = (q[axis.coordinate] - axis.lower) * axis.cells_per_length;
      if (!(place >= 0 && place < axis.cells)) return;
      cell = cell * static_cast<std::size_t>(axis.cells) + static_cast<std::size_t>(place);
    }
    WithDimension(d_, [&](auto known) {
      const std::size_t d = known() > 0 ? known() : d_;
      for (std::uint32_t at = begin_[cell]; at < begin_[cell + 1]; ++at) {
        const std::uint32_t i = balls_[at];
        const double squared = SquaredDistance(centres_ + i * d, q, static_cast<int>(d));
        if (squared < radii_[i] * radii_[i]) visit(i, squared);
      }
    });
  }

 private:
  static constexpr int kMaxCells = 1 << 15;
  static constexpr int kMaxAxes = 4;

  struct Axis {
    int coordinate = 0;
    double lower = 0, cells_per_length = 0;
    int cells = 1;
  };

  template <typename Visit>
  void ForEachCellOf(std::size_t ball, const Visit& visit) const;

  int d_;
  const double* centres_;
  std::vector<double> radii_;
  std::vector<Axis> axes_;
  std::vector<std::uint32_t> begin_;  // by cell: where its balls begin; one more at the end
  std::vector<std::uint32_t> balls_;
};

}  // namespace stellate::core
