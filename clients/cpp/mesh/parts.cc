#include "mesh/parts.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <set>
#include <utility>

#include "mesh/formats.h"
#include "mesh/groups.h"
#include "mesh/surface.h"

namespace stellate::client {
namespace {

using Eigen::Index;

bool IsClosed(const SimplexMatrix& triangles) {
  std::vector<std::array<std::uint32_t, 2>> edges;
  edges.reserve(static_cast<std::size_t>(triangles.size()));
  for (const auto& triangle : triangles.colwise()) {
    for (Index i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax({triangle[i], triangle[(i + 1) % 3]});
      edges.push_back({low, high});
    }
  }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 0; i < edges.size(); i += 2) {
    if (i + 1 == edges.size() || edges[i] != edges[i + 1]) return false;
    if (i + 2 < edges.size() && edges[i] == edges[i + 2]) return false;
  }
  return true;
}

Part PartOf(std::string name, const Mesh& mesh) {
  SimplexMatrix triangles = OrientedSimplices(mesh);
  if (mesh.dimension() == 3) triangles = BoundaryOf(triangles);
  std::map<std::uint64_t, std::vector<Index>> patches;
  for (Index j = 0; j < triangles.cols(); ++j) {
    std::uint64_t bits = mesh.walls.empty() ? 0 : ~std::uint64_t{0};
    for (Index i = 0; i < 3 && !mesh.walls.empty(); ++i) bits &= mesh.walls[triangles(i, j)];
    patches[bits].push_back(j);
  }
  auto [points, kept] = WithTheirPoints(InSpace(mesh.points), std::move(triangles));
  Part part{std::move(name), std::move(points), std::move(kept), {}};
  for (auto& [bits, columns] : patches)
    part.patches.push_back({WallName(bits), std::move(columns)});
  part.is_closed = IsClosed(part.triangles);
  return part;
}

}  // namespace

Expected<std::vector<Part>> PartsOf(const Mesh& mesh, const std::string& ending) {
  if (mesh.simplices.cols() == 0) {
    return Fail(ErrorCode::kFileFailed,
                "the mesh has no triangle, and " + ending + " holds nothing else");
  }
  std::set<int> labels(mesh.labels.begin(), mesh.labels.end());
  for (const Sides& sides : mesh.sides) labels.insert({sides.behind, sides.ahead});
  labels.erase(0);
  std::vector<Part> parts;
  if (labels.empty() || (labels.size() == 1 && mesh.region_names.empty())) {
    parts.push_back(PartOf("surface", mesh));
    return parts;
  }
  for (const int label : labels)
    parts.push_back(PartOf(RegionName(label, mesh.region_names), mesh.Region(label)));
  return parts;
}

Expected<void> CheckSinglePrecision(const Eigen::MatrixXd& points, const SimplexMatrix& triangles,
                                    const std::string& format) {
  for (const auto& triangle : triangles.colwise()) {
    Eigen::Matrix3f single;
    for (Index i = 0; i < 3; ++i) single.col(i) = points.col(triangle[i]).cast<float>();
    if (single.col(0) != single.col(1) && single.col(1) != single.col(2) &&
        single.col(2) != single.col(0))
      continue;
    return Fail(ErrorCode::kFileFailed,
                format +
                    " has single precision, in which vertices of this mesh fall together: "
                    "save it as .ply, or move it nearer to the origin");
  }
  return {};
}

}  // namespace stellate::client
