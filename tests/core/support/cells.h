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

// Half-spaces given one by one, for a cell that is not judged.
template <int K>
class GivenHalfSpaces final : public Surroundings<K> {
 public:
  explicit GivenHalfSpaces(double inradius) : inradius_(inradius) {}

  bool Clip(RestrictedVoronoiCell<K>& cell, std::uint32_t id, const double* normal, double offset) {
    std::array<double, K + 1>& given = given_[id];
    std::copy_n(normal, K, given.begin());
    given[K] = offset;
    return cell.Clip(id, normal, offset, scratch_, *this);
  }

  double HalfSpace(std::uint32_t id, double* normal) const override {
    if (IsFake(id)) return FakeHalfSpace<K>(static_cast<int>(id - kFirstFakeId), inradius_, normal);
    const std::array<double, K + 1>& given = given_.at(id);
    std::copy_n(given.begin(), K, normal);
    return given[K];
  }
  int judged_in() const override { return 0; }
  bool Centre(const std::uint32_t*, std::uint64_t, double*, double*) const override {
    return false;
  }
  void Lift(const double*, double*) const override {}

 private:
  double inradius_;
  std::map<std::uint32_t, std::array<double, K + 1>> given_;
  typename RestrictedVoronoiCell<K>::Scratch scratch_;
};

// A cell without what its history may order differently: its vertices' coordinates, bit for bit,
// by the ids of their facets.
template <int K>
std::map<std::array<std::uint32_t, K>, std::array<std::uint64_t, K>> Canonical(
    const RestrictedVoronoiCell<K>& cell) {
  std::map<std::array<std::uint32_t, K>, std::array<std::uint64_t, K>> all;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    std::array<std::uint32_t, K> ids;
    std::array<std::uint64_t, K> bits;
    for (int s = 0; s < K; ++s) {
      ids[static_cast<std::size_t>(s)] = cell.id(cell.facet(v, s));
      bits[static_cast<std::size_t>(s)] = std::bit_cast<std::uint64_t>(cell.x(v)[s]);
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
  const auto fail = [](std::size_t v) {
    return ::testing::AssertionFailure() << "K = " << K << ", vertex " << v << ": ";
  };
  const auto facets_of = [&](std::size_t v) {
    Facets ids;
    for (int s = 0; s < K; ++s) ids.insert(cell.id(cell.facet(v, s)));
    return ids;
  };
  std::set<Facets> faces;
  std::set<std::uint32_t> used;
  double max_norm2 = 0;
  bool any_fake = false;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const Facets mine = facets_of(v);
    if (mine.size() != K) return fail(v) << "a facet twice";
    std::uint64_t key = 0;
    double norm2 = 0;
    for (int s = 0; s < K; ++s) {
      const std::uint32_t id = cell.id(cell.facet(v, s));
      key += Mix64(id);
      norm2 += cell.x(v)[s] * cell.x(v)[s];
      used.insert(id);
      any_fake = any_fake || IsFake(id);

      const std::size_t w = cell.adjacent(v, s);
      if (w >= cell.vertex_count() || w == v) return fail(v) << "no neighbour in slot " << s;
      Facets shared = mine;
      shared.erase(id);
      for (const std::uint32_t other : shared)
        if (!facets_of(w).contains(other)) return fail(v) << "does not share an edge with " << w;
      if (facets_of(w).contains(id)) return fail(v) << "the same facets as " << w;
      bool back = false;
      for (int r = 0; r < K; ++r) back = back || cell.adjacent(w, r) == v;
      if (!back) return fail(v) << "not adjacent from " << w;
    }
    if (key != cell.key(v)) return fail(v) << "wrong key";
    if (!(std::abs(norm2 - cell.norm2(v)) <= 1e-12 * norm2)) return fail(v) << "wrong norm";
    max_norm2 = std::max(max_norm2, cell.norm2(v));
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
  if (used.size() != cell.facet_count())
    return ::testing::AssertionFailure() << "K = " << K << ": a facet without a vertex";
  if (max_norm2 != cell.max_norm2())
    return ::testing::AssertionFailure() << "K = " << K << ": wrong largest norm";
  if (cell.bounded() == any_fake)
    return ::testing::AssertionFailure() << "K = " << K << ": wrong about its fake facets";
  return ::testing::AssertionSuccess();
}

}  // namespace stellate::core::testing
