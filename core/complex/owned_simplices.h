#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/complex/stars.h"

namespace stellate::core {

// Inside of Stars, shared by its sources: the simplices of a star whose lowest vertex is its point.

// Calls visit(v, triangle) for the triangles of a polygon, the cell of p, whose lowest vertex is p.
template <typename Polygon, typename Visit>
void ForEachOwnedTriangle(std::uint32_t p, const Polygon& cell, const Visit& visit) {
  using Triangle = std::array<std::uint32_t, 3>;
  const std::size_t count = cell.facet_count();
  const auto is_above = [p](std::uint32_t q) { return q > p && IsSample(q); };
  for (std::size_t v = 0; v < count; ++v) {
    const std::uint32_t a = cell.id(v), b = cell.id(v + 1 < count ? v + 1 : 0);
    if (is_above(a) && is_above(b)) visit(v, a < b ? Triangle{p, a, b} : Triangle{p, b, a});
  }
}

template <std::size_t N>
void AppendTo(std::vector<std::uint32_t>* ids, const std::array<std::uint32_t, N>& simplex) {
  ids->insert(ids->end(), simplex.begin(), simplex.end());
}

// Calls visit(v, simplex) once for each simplex of a sector of star(p) whose lowest vertex is p: at
// common centres a cell that is far from convex may hold one at two vertices.
template <int K>
template <typename Visit>
void Stars<K>::ForEachOwned(std::uint32_t p, int sector, const Visit& visit) const {
  if (options_.boundary_only) return;
  const Cell& cell = this->cell(p, sector);
  if constexpr (K == 2) {
    if (centre_rule() == CentreRule::kTangentSpace) return ForEachOwnedTriangle(p, cell, visit);
  }
  Simplex simplex;
  thread_local std::vector<std::uint64_t> keys;
  keys.clear();
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    bool lowest = true;
    for (int i = 0; i < K; ++i) lowest = lowest && cell.id(cell.facet(v, i)) > p;
    if (!lowest || !SimplexOf(p, cell, v, &simplex)) continue;
    if (centre_rule() == CentreRule::kCommonCentre) {
      if (std::find(keys.begin(), keys.end(), cell.key(v)) != keys.end()) continue;
      keys.push_back(cell.key(v));
    }
    visit(v, simplex);
  }
}

}  // namespace stellate::core
