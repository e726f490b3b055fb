#include "mesh/surface.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>
#include <vector>

#include "mesh/formats.h"

namespace stellate::client {
namespace {

using Index = Eigen::Index;
using Vertex = SimplexMatrix::Scalar;

}  // namespace

SimplexMatrix BoundaryOf(const SimplexMatrix& simplices) {
  const Index width = simplices.rows() - 1;
  SimplexMatrix facets(width, simplices.cols() * (width + 1));
  std::vector<std::pair<std::vector<Vertex>, Index>> sorted;
  for (Index j = 0; j < simplices.cols(); ++j) {
    for (Index out = 0; out <= width; ++out) {
      const Index at = j * (width + 1) + out;
      for (Index i = 0; i < width; ++i) facets(i, at) = simplices(i < out ? i : i + 1, j);
      if (out % 2 == 1) std::swap(facets(width - 2, at), facets(width - 1, at));
      std::vector<Vertex> name(facets.col(at).begin(), facets.col(at).end());
      std::sort(name.begin(), name.end());
      sorted.emplace_back(std::move(name), at);
    }
  }
  std::sort(sorted.begin(), sorted.end());
  std::vector<Index> alone;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const bool like_last = i > 0 && sorted[i].first == sorted[i - 1].first;
    const bool like_next = i + 1 < sorted.size() && sorted[i].first == sorted[i + 1].first;
    if (!like_last && !like_next) alone.push_back(sorted[i].second);
  }
  std::sort(alone.begin(), alone.end());
  return facets(Eigen::all, alone);
}

Drawn WithTheirPoints(const Eigen::MatrixXd& points, SimplexMatrix simplices) {
  std::vector<Index> place(static_cast<std::size_t>(points.cols()), -1), used;
  for (const Vertex id : simplices.reshaped()) place[id] = 0;
  for (std::size_t id = 0; id < place.size(); ++id) {
    if (place[id] < 0) continue;
    place[id] = std::ssize(used);
    used.push_back(static_cast<Index>(id));
  }
  for (Vertex& id : simplices.reshaped()) id = static_cast<Vertex>(place[id]);
  return {points(Eigen::all, used), std::move(simplices)};
}

Drawn DrawnOf(const Mesh& mesh) {
  Drawn drawn{InSpace(mesh.points), OrientedSimplices(mesh)};
  if (mesh.dimension() != 3) return drawn;
  return WithTheirPoints(drawn.points, BoundaryOf(drawn.simplices));
}

}  // namespace stellate::client
