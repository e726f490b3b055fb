#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "core/geometry/restricted_voronoi_cell.h"

namespace stellate::core::testing {

// A cell without what its history may order differently: its vertices' coordinates, bit for bit,
// by the ids of their facets.
template <int K>
std::map<std::array<std::uint32_t, K>, std::array<std::uint64_t, K>> Canonical(
    const RestrictedVoronoiCell<K>& cell) {
  std::map<std::array<std::uint32_t, K>, std::array<std::uint64_t, K>> all;
  for (const auto& v : cell.vertices()) {
    std::array<std::uint32_t, K> ids;
    std::array<std::uint64_t, K> bits;
    for (std::size_t s = 0; s < K; ++s) {
      ids[s] = cell.facets()[v.facet[s]].id;
      bits[s] = std::bit_cast<std::uint64_t>(v.x[s]);
    }
    std::sort(ids.begin(), ids.end());
    all[ids] = bits;
  }
  return all;
}

// The laws of a simple polytope: K facets and K neighbours a vertex, a neighbour on all facets but
// one, adjacency symmetric, every facet in use, and Euler's relation over the faces of all
// dimensions; and what the cell caches is what its facets say.
template <int K>
::testing::AssertionResult CombinatoricsHold(const RestrictedVoronoiCell<K>& cell) {
  using Facets = std::set<std::uint32_t>;  // ids
  const auto& vertices = cell.vertices();
  const auto fail = [](std::size_t v) {
    return ::testing::AssertionFailure() << "K = " << K << ", vertex " << v << ": ";
  };
  const auto facets_of = [&](std::size_t v) {
    Facets ids;
    for (const auto f : vertices[v].facet) ids.insert(cell.facets()[f].id);
    return ids;
  };
  std::set<Facets> faces;
  std::map<std::uint32_t, std::size_t> used;  // by facet, how many vertices are on it
  double max_norm2 = 0;
  bool any_fake = false;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const Facets mine = facets_of(v);
    if (mine.size() != K) return fail(v) << "a facet twice";
    std::uint64_t key = 0;
    double norm2 = 0;
    for (int s = 0; s < K; ++s) {
      const auto& facet = cell.facets()[vertices[v].facet[s]];
      key += Mix64(facet.id);
      norm2 += vertices[v].x[s] * vertices[v].x[s];
      ++used[facet.id];
      any_fake = any_fake || IsFake(facet.id);

      const std::size_t w = vertices[v].adjacent[s];
      if (w >= vertices.size() || w == v) return fail(v) << "no neighbour in slot " << s;
      Facets shared = mine;
      shared.erase(facet.id);
      for (const std::uint32_t id : shared)
        if (!facets_of(w).contains(id)) return fail(v) << "does not share an edge with " << w;
      if (facets_of(w).contains(facet.id)) return fail(v) << "the same facets as " << w;
      const auto* back = vertices[w].adjacent;
      if (std::find(back, back + K, v) == back + K) return fail(v) << "not adjacent from " << w;
    }
    if (key != vertices[v].key) return fail(v) << "wrong key";
    if (!(std::abs(norm2 - vertices[v].norm2) <= 1e-12 * norm2)) return fail(v) << "wrong norm";
    max_norm2 = std::max(max_norm2, vertices[v].norm2);
    for (unsigned subset = 0; subset < (1u << K); ++subset) {
      Facets face;
      int bit = 0;
      for (const std::uint32_t id : mine)
        if (subset >> bit++ & 1) face.insert(id);
      faces.insert(face);
    }
  }
  int euler = 0;  // a face of dimension j lies on K - j facets; the polytope itself is one
  for (const Facets& face : faces) euler += (K - static_cast<int>(face.size())) % 2 ? -1 : 1;
  if (euler != 1) return ::testing::AssertionFailure() << "K = " << K << ": Euler sum " << euler;
  if (used.size() != cell.facets().size())
    return ::testing::AssertionFailure() << "K = " << K << ": a facet without a vertex";
  for (const auto& facet : cell.facets())
    if (used.at(facet.id) != facet.vertices)
      return ::testing::AssertionFailure()
             << "K = " << K << ": wrong number of vertices on a facet";
  if (max_norm2 != cell.max_norm2())
    return ::testing::AssertionFailure() << "K = " << K << ": wrong largest norm";
  if (cell.bounded() == any_fake)
    return ::testing::AssertionFailure() << "K = " << K << ": wrong about its fake facets";
  return ::testing::AssertionSuccess();
}

}  // namespace stellate::core::testing
