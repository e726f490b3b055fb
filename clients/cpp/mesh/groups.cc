#include "mesh/groups.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <iterator>
#include <map>
#include <utility>

namespace stellate::client {
namespace {

using Eigen::Index;
using Ids = std::vector<std::uint32_t>;

// Turns facets, ascending in each column, as the cells that have them induce their orientation:
// where two have one, that in the region of the lower label, which comes first. `labels`: of the
// cells, or empty; then the facets get no sides.
void Turn(Group* facets_of, const SimplexMatrix& cells, const std::vector<std::uint8_t>& labels) {
  const SimplexMatrix facets = facets_of->simplices;
  std::vector<Sides>& sides = facets_of->sides;
  if (!labels.empty()) sides.resize(static_cast<size_t>(facets.cols()));
  std::map<Ids, Index> wanted;
  for (Index j = 0; j < facets.cols(); ++j) {
    wanted[Ids(facets.col(j).begin(), facets.col(j).end())] = j;
  }
  std::vector<bool> on(static_cast<size_t>(cells.maxCoeff()) + 1, false);
  for (const std::uint32_t id : facets.reshaped()) on[id] = true;
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
      Sides* const of = labels.empty() ? nullptr : &sides[static_cast<size_t>(place->second)];
      if (of != nullptr && of->behind != 0) {
        of->ahead = labels[static_cast<size_t>(j)];
        continue;
      }
      if (of != nullptr) of->behind = labels[static_cast<size_t>(j)];
      if (out % 2 == 1) std::iter_swap(facet.end() - 2, facet.end() - 1);
      std::copy(facet.begin(), facet.end(), facets_of->simplices.col(place->second).begin());
      if (of == nullptr) wanted.erase(place);
    }
  }
}

Group GroupOf(Face face, std::ptrdiff_t tag) {
  std::uint64_t walls = 0;
  for (const int wall : face.walls) walls |= std::uint64_t{1} << wall;
  return {static_cast<int>(tag), WallName(walls), walls, std::move(face.simplices)};
}

// A boundary without its inside: its walls, and where they meet.
std::vector<Group> GroupsOfBoundary(const Mesh& mesh) {
  const SimplexMatrix cells = OrientedSimplices(mesh);
  std::map<Ids, Index> place;
  for (Index j = 0; j < mesh.simplices.cols(); ++j) {
    place[Ids(mesh.simplices.col(j).begin(), mesh.simplices.col(j).end())] = j;
  }
  std::vector<Group> groups;
  for (int dimension = mesh.dimension(); dimension >= 0; --dimension) {
    for (Face& face : mesh.faces(dimension)) {
      Group& group = groups.emplace_back(GroupOf(std::move(face), std::ssize(groups) + 1));
      for (Index j = 0; dimension == mesh.dimension() && j < group.simplices.cols(); ++j) {
        const Ids ids(group.simplices.col(j).begin(), group.simplices.col(j).end());
        const Index at = place.at(ids);
        Sides sides = mesh.sides[static_cast<size_t>(at)];
        if (cells.col(at) != group.simplices.col(j)) std::swap(sides.behind, sides.ahead);
        group.simplices.col(j) = cells.col(at);
        group.sides.push_back(sides);
      }
    }
  }
  return groups;
}

}  // namespace

std::string RegionName(int label, const std::vector<std::string>& names) {
  const auto cleaned = [&names](size_t i) {
    std::string name;
    for (const char c : names[i]) name += c == ' ' || c == '"' || c == '\\' ? '_' : c;
    return name;
  };
  const auto at = static_cast<size_t>(label) - 1;
  if (at < names.size() && !names[at].empty()) {
    std::string name = cleaned(at);
    bool alone = true;
    for (size_t i = 0; i < names.size(); ++i) alone = alone && (i == at || cleaned(i) != name);
    if (alone) return name;
  }
  return "region_" + std::to_string(label);
}

std::string WallName(std::uint64_t walls) {
  std::string name = std::popcount(walls) > 1 ? "walls" : "wall";
  if (walls == 0) return "";
  for (; walls != 0; walls &= walls - 1) name += "_" + std::to_string(std::countr_zero(walls));
  return name;
}

std::vector<Group> GroupsOf(const Mesh& mesh, const std::vector<std::uint8_t>& known) {
  if (mesh.is_boundary()) return GroupsOfBoundary(mesh);
  SimplexMatrix cells = OrientedSimplices(mesh);
  std::vector<Group> groups;
  std::map<std::uint8_t, std::vector<Index>> regions;
  for (size_t j = 0; j < mesh.labels.size(); ++j) {
    regions[mesh.labels[j]].push_back(static_cast<Index>(j));
  }
  for (const std::uint8_t label : known) regions[label];
  if (regions.empty()) groups.push_back({1, "inside", 0, cells});
  std::vector<Index> by_region;
  std::vector<std::uint8_t> labels;
  for (const auto& [label, columns] : regions) {
    by_region.insert(by_region.end(), columns.begin(), columns.end());
    labels.insert(labels.end(), columns.size(), label);
    const bool is_all = regions.size() == 1 && mesh.region_names.empty();
    groups.push_back({static_cast<int>(groups.size()) + 1,
                      is_all ? "inside" : RegionName(label, mesh.region_names), 0,
                      cells(Eigen::all, columns), label});
  }
  if (!by_region.empty()) cells = SimplexMatrix(cells(Eigen::all, by_region));
  for (int dimension = mesh.dimension() - 1; dimension >= 0; --dimension) {
    for (Face& face : mesh.faces(dimension)) {
      Group& group = groups.emplace_back(GroupOf(std::move(face), std::ssize(groups) + 1));
      if (dimension == mesh.dimension() - 1 && dimension >= 1) Turn(&group, cells, labels);
    }
  }
  return groups;
}

}  // namespace stellate::client
