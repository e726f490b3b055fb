// The faces of a mesh with boundary: of its boundary, edges, corners.
#include <algorithm>
#include <bit>
#include <cstdint>
#include <map>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stellate/mesh.h"

namespace stellate {
namespace {

using Eigen::Index;
using WallBits = std::uint64_t;

// All columns with one entry left out.
SimplexMatrix Subsets(const SimplexMatrix& simplices) {
  const Index width = simplices.rows(), count = simplices.cols();
  SimplexMatrix subsets(width - 1, width * count);
  for (Index out = 0; out < width; ++out) {
    subsets.middleCols(out * count, count).topRows(out) = simplices.topRows(out);
    subsets.middleCols(out * count, count).bottomRows(width - 1 - out) =
        simplices.bottomRows(width - 1 - out);
  }
  return subsets;
}

bool AreEqual(const SimplexMatrix& simplices, Index a, Index b) {
  return (simplices.col(a).array() == simplices.col(b).array()).all();
}

// The numbers of the columns in lexicographic order.
std::vector<Index> Sorted(const SimplexMatrix& simplices, std::vector<Index> columns) {
  std::sort(columns.begin(), columns.end(), [&](Index a, Index b) {
    const auto x = simplices.col(a), y = simplices.col(b);
    return std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end());
  });
  return columns;
}

std::vector<Index> AllOf(const SimplexMatrix& simplices) {
  std::vector<Index> all(static_cast<size_t>(simplices.cols()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// The facets in one simplex alone, or, with labels, in several of different ones; in lexicographic
// order.
SimplexMatrix Bounding(const SimplexMatrix& simplices, const std::vector<std::uint8_t>& labels) {
  const SimplexMatrix facets = Subsets(simplices);
  const auto differ = [&](Index a, Index b) {
    return !labels.empty() && labels[static_cast<size_t>(a % simplices.cols())] !=
                                  labels[static_cast<size_t>(b % simplices.cols())];
  };
  const std::vector<Index> order = Sorted(facets, AllOf(facets));
  std::vector<Index> bounding;
  for (size_t i = 0; i < order.size();) {
    bool bounds = true;
    size_t end = i + 1;
    for (; end < order.size() && AreEqual(facets, order[i], order[end]); ++end) {
      bounds = (bounds && end > i + 1) || differ(order[i], order[end]);
    }
    if (bounds) bounding.push_back(order[i]);
    i = end;
  }
  return facets(Eigen::all, bounding);
}

WallBits InCommon(const std::vector<WallBits>& walls, const SimplexMatrix& simplices, Index j) {
  WallBits bits = ~WallBits{0};
  for (const std::uint32_t vertex : simplices.col(j)) bits &= walls[vertex];
  return bits;
}

// Of these faces' own faces those that lie on more walls than a face that has them, each once.
SimplexMatrix Ridges(const SimplexMatrix& rows, const std::vector<WallBits>& walls) {
  const SimplexMatrix subsets = Subsets(rows);
  std::vector<Index> inner;
  for (Index j = 0; j < subsets.cols(); ++j) {
    if (InCommon(walls, subsets, j) != InCommon(walls, rows, j % rows.cols())) inner.push_back(j);
  }
  inner = Sorted(subsets, std::move(inner));
  const auto same = [&](Index a, Index b) { return AreEqual(subsets, a, b); };
  inner.erase(std::unique(inner.begin(), inner.end(), same), inner.end());
  return subsets(Eigen::all, inner);
}

Walls ListOf(WallBits bits) {
  Walls walls;
  for (; bits != 0; bits &= bits - 1) walls.push_back(std::countr_zero(bits));
  return walls;
}

// The faces of a mesh, of a dimension below k; with labels, those between regions, too; of the
// boundary alone of its own dimension, too.
std::vector<Face> FacesOf(const Mesh& mesh, int dimension,
                          const std::vector<std::uint8_t>& labels) {
  const std::vector<WallBits>& walls = mesh.walls;
  if (walls.empty() || dimension < 0 || dimension >= mesh.dimension() + mesh.is_boundary() ||
      mesh.simplices.cols() == 0) {
    return {};
  }
  SimplexMatrix rows = mesh.is_boundary() ? mesh.simplices : Bounding(mesh.simplices, labels);
  while (rows.rows() - 1 > dimension && rows.cols() > 0) rows = Ridges(rows, walls);
  std::map<Walls, std::vector<Index>> of_walls;
  for (Index j = 0; j < rows.cols(); ++j) {
    if (const WallBits bits = InCommon(walls, rows, j); bits != 0) {
      of_walls[ListOf(bits)].push_back(j);
    }
  }
  std::vector<Face> faces;
  faces.reserve(of_walls.size());
  for (const auto& [on, columns] : of_walls) faces.push_back({on, rows(Eigen::all, columns)});
  return faces;
}

}  // namespace

Mesh Mesh::Region(int label) const {
  std::vector<Index> columns;
  std::vector<Sides> alone;
  std::set<int> all(labels.begin(), labels.end());
  for (size_t j = 0; j < labels.size(); ++j) {
    if (labels[j] == label) columns.push_back(static_cast<Index>(j));
  }
  for (size_t j = 0; j < sides.size(); ++j) {
    all.insert({sides[j].behind, sides[j].ahead});
    const bool behind = sides[j].behind == label, ahead = sides[j].ahead == label;
    if (!behind && !ahead) continue;
    columns.push_back(static_cast<Index>(j));  // what else is there is outside of it
    alone.push_back(
        {behind ? sides[j].behind : std::uint8_t{0}, ahead ? sides[j].ahead : std::uint8_t{0}});
  }
  all.erase(0);
  if (columns.empty() || label == 0) {
    std::string have;
    for (const int known : all) {
      have += (have.empty() ? "" : ", ") + std::to_string(known);
    }
    throw std::invalid_argument("the mesh has no region " + std::to_string(label) + "; it has [" +
                                have + "]");
  }
  return {points, simplices(Eigen::all, columns), {}, walls, {}, {}, std::move(alone)};
}

std::vector<Face> Mesh::boundary() const {
  return FacesOf(*this, is_boundary() ? dimension() : dimension() - 1, {});
}

std::vector<Face> Mesh::faces(int dimension) const { return FacesOf(*this, dimension, labels); }

std::vector<Face> Mesh::edges() const {
  std::vector<Face> edges = faces(1);
  std::erase_if(edges, [](const Face& face) { return face.walls.size() < 2; });
  return edges;
}

std::vector<Face> Mesh::corners() const {
  std::vector<Face> corners = faces(0);
  const size_t least = static_cast<size_t>(dimension()) + (is_boundary() ? 1 : 0);
  std::erase_if(corners, [least](const Face& face) { return face.walls.size() < least; });
  return corners;
}

}  // namespace stellate
