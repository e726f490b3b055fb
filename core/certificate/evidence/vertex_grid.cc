#include "core/certificate/evidence/vertex_grid.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/parallel.h"
#include "core/certificate/evidence/probes.h"

namespace stellate::core {
namespace {

constexpr double kMostCells = 4;  // a vertex: more would be empty

}  // namespace

VertexGrid::VertexGrid(const MeshView& mesh, double radius)
    : mesh_(mesh), radius2_(radius * radius) {
  const MeshBox box = BoxOf(mesh);
  const Eigen::VectorXd lengths = box.upper - box.lower;
  std::vector<int> order(static_cast<std::size_t>(mesh.d));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return lengths[a] > lengths[b]; });
  axes_ = std::min(mesh.d, kMaxAxes);
  // Wider cubes are correct as well, only slower: the number of cubes is bounded.
  double width = radius;
  for (bool fits = false; !fits; width *= fits ? 1 : 2) {
    double cells = 1;
    for (int a = 0; a < axes_; ++a) cells *= std::floor(lengths[order[a]] / width) + 1;
    fits = cells <= kMostCells * static_cast<double>(mesh.vertices) + 1;
  }
  cells_per_length_ = 1 / width;
  std::uint64_t count = 1;
  for (int a = 0; a < axes_; ++a) {
    coordinate_[a] = order[static_cast<std::size_t>(a)];
    lower_[a] = box.lower[coordinate_[a]];
    cells_[a] = static_cast<std::int64_t>(lengths[coordinate_[a]] / width) + 1;
    count *= static_cast<std::uint64_t>(cells_[a]);
  }
  begin_.assign(count + 1, 0);
  std::vector<std::uint32_t> cell(mesh.vertices);
  ParallelFor(mesh.vertices, [&](std::uint64_t v) {
    cell[v] = static_cast<std::uint32_t>(CellOf(mesh.Point(static_cast<std::uint32_t>(v))));
  });
  for (const std::uint32_t c : cell) ++begin_[c + 1];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  vertices_.resize(mesh.vertices);
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  places_.resize(mesh.vertices);
  for (std::uint32_t v = 0; v < mesh.vertices; ++v) {
    const std::uint32_t at = next[cell[v]]++;
    vertices_[at] = v;
    for (int a = 0; a < axes_; ++a) places_[at][a] = mesh.Point(v)[coordinate_[a]];
  }
}

std::uint64_t VertexGrid::CellOf(const double* x) const {
  std::uint64_t cell = 0;
  for (int a = 0; a < axes_; ++a) {
    const auto place =
        static_cast<std::int64_t>((x[coordinate_[a]] - lower_[a]) * cells_per_length_);
    cell = cell * static_cast<std::uint64_t>(cells_[a]) +
           static_cast<std::uint64_t>(std::clamp<std::int64_t>(place, 0, cells_[a] - 1));
  }
  return cell;
}

}  // namespace stellate::core
