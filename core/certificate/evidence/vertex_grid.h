#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "core/base/vector_ops.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// Finds the vertices of a mesh within a fixed radius of a point. The vertices are sorted into cubes
// as wide as the radius, along the coordinates in which they spread most. Const queries may run in
// parallel.
//
//   VertexGrid grid(mesh, radius);
//   grid.ForEachAround(q, [](std::uint32_t v, double distance2) { ... });
class VertexGrid {
 public:
  VertexGrid(const MeshView& mesh, double radius);

  // Calls visit(v, |q - v|^2) for each vertex with |q - v| < radius, in a fixed order.
  template <typename Visit>
  void ForEachAround(const double* q, const Visit& visit) const {
    std::array<std::int64_t, kMaxAxes> low{}, high{}, at{};
    std::array<double, kMaxAxes> there{};  // q along the axes; 0 beyond the last
    for (int a = 0; a < axes_; ++a) {
      there[a] = q[coordinate_[a]];
      const double place = (there[a] - lower_[a]) * cells_per_length_;
      if (!(place >= -1 && place < static_cast<double>(cells_[a]) + 1)) return;
      low[a] = at[a] = std::max<std::int64_t>(static_cast<std::int64_t>(place) - 1, 0);
      high[a] = std::min<std::int64_t>(static_cast<std::int64_t>(place) + 1, cells_[a] - 1);
      if (low[a] > high[a]) return;
    }
    int axis = 0;
    do {
      std::uint64_t cell = 0;
      for (int a = 0; a < axes_; ++a)
        cell = cell * static_cast<std::uint64_t>(cells_[a]) + static_cast<std::uint64_t>(at[a]);
      for (std::uint32_t i = begin_[cell]; i < begin_[cell + 1]; ++i) {
        double along2 = 0;
        for (int a = 0; a < kMaxAxes; ++a) {
          const double step = places_[i][a] - there[a];
          along2 += step * step;
        }
        if (along2 >= radius2_) continue;
        const double squared = SquaredDistance(mesh_.Point(vertices_[i]), q, mesh_.d);
        if (squared < radius2_) visit(vertices_[i], squared);
      }
      for (axis = 0; axis < axes_ && at[axis]++ == high[axis]; ++axis) at[axis] = low[axis];
    } while (axis < axes_);
  }

 private:
  static constexpr int kMaxAxes = 3;

  std::uint64_t CellOf(const double* x) const;

  const MeshView& mesh_;
  double radius2_;
  int axes_ = 0;
  double cells_per_length_ = 0;
  std::array<int, kMaxAxes> coordinate_{};
  std::array<double, kMaxAxes> lower_{};
  std::array<std::int64_t, kMaxAxes> cells_{};
  std::vector<std::uint32_t> begin_;     // by cell: where its vertices begin; one more at the end
  std::vector<std::uint32_t> vertices_;  // by cell, ascending
  std::vector<std::array<double, kMaxAxes>> places_;  // theirs along the axes, as `there`
};

}  // namespace stellate::core
