#include "mesh/groups.h"

#include <algorithm>
#include <map>
#include <utility>

namespace stellate::client {
namespace {

using Eigen::Index;
using Ids = std::vector<std::uint32_t>;

// The facets, ascending in each column, as the cells that have them induce their orientation: where
// two have one, that in the region of the lower label, which comes first.
SimplexMatrix Turned(const SimplexMatrix& facets, const SimplexMatrix& cells) {
  std::map<Ids, Index> wanted;
  for (Index j = 0; j < facets.cols(); ++j) {
    wanted[Ids(facets.col(j).begin(), facets.col(j).end())] = j;
  }
  std::vector<bool> on(static_cast<size_t>(cells.maxCoeff()) + 1, false);
  for (const std::uint32_t id : facets.reshaped()) on[id] = true;
  SimplexMatrix turned = facets;
  Ids facet(static_cast<size_t>(facets.rows()));
  for (Index j = 0; j < cells.cols(); ++j) {
    for (Index out = 0; out < cells.rows(); ++out) {
      for (Index i = 0; i < facets.rows(); ++i) {
        facet[static_cast<size_t>(i)] = cells(i < out ? i : i + 1, j);
      }
      if (!std::all_of(facet.begin(), facet.end(), [&on](std::uint32_t id) { return on[id]; })) {
        continue;
      }
      Ids ascending = facet;
      std::sort(ascending.begin(), ascending.end());
      const auto place = wanted.find(ascending);
      if (place == wanted.end()) continue;
      if (out % 2 == 1) std::iter_swap(facet.end() - 2, facet.end() - 1);
      std::copy(facet.begin(), facet.end(), turned.col(place->second).begin());
      wanted.erase(place);
    }
  }
  return turned;
}

Group GroupOf(Face face, int tag) {
  Group group{tag, face.walls.size() > 1 ? "walls" : "wall", 0, std::move(face.simplices)};
  for (const int wall : face.walls) {
    group.name += '_';
    group.name += std::to_string(wall);
    group.walls |= std::uint64_t{1} << wall;
  }
  return group;
}

}  // namespace

std::vector<Group> GroupsOf(const Mesh& mesh) {
  SimplexMatrix cells = OrientedSimplices(mesh);
  std::vector<Group> groups;
  std::map<std::uint8_t, std::vector<Index>> regions;
  for (size_t j = 0; j < mesh.labels.size(); ++j) {
    regions[mesh.labels[j]].push_back(static_cast<Index>(j));
  }
  if (regions.size() < 2) groups.push_back({1, "inside", 0, cells});
  std::vector<Index> by_region;
  for (const auto& [label, columns] : regions) {
    by_region.insert(by_region.end(), columns.begin(), columns.end());
    if (regions.size() < 2) continue;
    groups.push_back({static_cast<int>(groups.size()) + 1, "region_" + std::to_string(label), 0,
                      cells(Eigen::all, columns)});
  }
  if (!by_region.empty()) cells = SimplexMatrix(cells(Eigen::all, by_region));
  for (int dimension = mesh.dimension() - 1; dimension >= 0; --dimension) {
    for (Face& face : mesh.faces(dimension)) {
      if (dimension == mesh.dimension() - 1 && dimension >= 1) {
        face.simplices = Turned(face.simplices, cells);
      }
      groups.push_back(GroupOf(std::move(face), static_cast<int>(groups.size()) + 1));
    }
  }
  return groups;
}

Index CountSimplices(const std::vector<Group>& groups) {
  Index count = 0;
  for (const Group& group : groups) count += group.simplices.cols();
  return count;
}

}  // namespace stellate::client
