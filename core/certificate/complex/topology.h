#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/specification.h"

namespace stellate::core {

// A complex of k-simplices, k+1 strictly ascending vertex ids each, side by side. Borrowed.
struct SimplexList {
  int k = 0;
  std::uint32_t vertices = 0;
  const std::vector<std::uint32_t>* ids = nullptr;

  std::uint32_t size() const { return static_cast<std::uint32_t>(ids->size() / (k + 1)); }
  const std::uint32_t* operator[](std::uint32_t s) const {
    return ids->data() + static_cast<std::size_t>(s) * (k + 1);
  }
};

// Returns "" if the list is well formed: whole simplices, ids ascending and below `vertices`, fewer
// than 2^32 - 2 simplices. Else says in plain words which simplex is not.
std::string CheckSimplexList(const SimplexList& list);

// Lists the simplices that meet at each vertex. Takes 4 (k + 1) bytes per simplex and 8 per vertex.
//
//   const VertexStars stars(list);
//   for (std::uint32_t s : stars.Star(v)) Visit(list[s]);
class VertexStars {
 public:
  static constexpr std::uint32_t kNone = 0xffffffffu;

  // REQUIRES: CheckSimplexList(list) is empty.
  explicit VertexStars(const SimplexList& list);

  const SimplexList& list() const { return list_; }

  // The simplices at vertex v, ascending.
  std::span<const std::uint32_t> Star(std::uint32_t v) const {
    return {incident_.data() + begin_[v], incident_.data() + begin_[v + 1]};
  }

 private:
  SimplexList list_;
  std::vector<std::uint64_t> begin_;
  std::vector<std::uint32_t> incident_;
};

// Also knows which simplices share a facet. Time and memory are linear in the mesh for bounded
// stars: 8 (k + 1) bytes per simplex.
//
//   const Adjacency adjacency(list);
//   if (adjacency.bad_facets() == 0) Visit(adjacency.Across(s, 0));  // opposite s's first vertex
class Adjacency : public VertexStars {
 public:
  // `apex`: a vertex that may be in any number of simplices. In a complex of edges it is a facet
  // itself, which is then not counted. REQUIRES: as for VertexStars.
  explicit Adjacency(const SimplexList& list, std::uint32_t apex = kNone)
      : Adjacency(VertexStars(list), apex) {}
  explicit Adjacency(VertexStars stars, std::uint32_t apex = kNone);

  // Returns the simplex across the facet opposite vertex number i of simplex s; kNone unless that
  // facet is in exactly two simplices, on different vertex sets.
  std::uint32_t Across(std::uint32_t s, int i) const { return Across(s)[i]; }
  // Returns all k + 1 of them. No simplex is across two facets: the two would have all vertices in
  // common.
  const std::uint32_t* Across(std::uint32_t s) const {
    return across_.data() + static_cast<std::size_t>(s) * (list().k + 1);
  }
  // Returns the number of t's vertex that is not in s. REQUIRES: t is across a facet of s.
  int Apex(std::uint32_t s, std::uint32_t t) const {
    int j = 0;
    while (Across(t)[j] != s) ++j;
    return j;
  }

  std::uint64_t facets() const { return facets_.all; }      // distinct (k-1)-faces
  std::uint64_t bad_facets() const { return facets_.bad; }  // not in exactly two simplices
  // The first bad facet in id order, with the number of simplices it is in; empty if none.
  const std::string& first_bad_facet() const { return facets_.first_bad; }
  // The first Violations::kMost bad facets, k ids each.
  const std::vector<std::uint32_t>& some_bad_facets() const { return facets_.some_bad; }

 private:
  struct FacetCount {
    std::uint64_t all = 0, bad = 0;
    std::string first_bad;
    std::vector<std::uint32_t> some_bad;
  };
  void MatchFacets(std::uint32_t apex);
  template <int K>
  FacetCount MatchFacetsOf(std::uint32_t begin, std::uint32_t end, std::uint32_t apex);

  std::vector<std::uint32_t> across_;
  FacetCount facets_;
};

// The connected parts of a complex, and its orientation.
struct Connectivity {
  std::uint64_t components = 0;         // of the complex; vertices without a simplex not counted
  std::uint64_t isolated_vertices = 0;  // in no simplex
  std::vector<std::uint32_t> some_isolated;  // the first Violations::kMost of them
  bool orientable = false;  // neighbours across facets can be oriented alike, facets being good
  // By simplex, 1 or -1: the orientation of its order of ids. Neighbours across facets are oriented
  // alike. Empty unless orientable.
  std::vector<std::int8_t> orientation;
};

Connectivity ComputeConnectivity(const Adjacency& adjacency);

// Returns the same, without an orientation, for a complex whose vertex links are spheres, from how
// each simplex is oriented at its vertices. `sides`: by simplex, bit i for vertex number i: orient
// all simplices at that vertex alike; the bit says whether this orientation is the opposite of the
// order of the simplex's ids.
Connectivity ComputeConnectivity(const SimplexList& list, std::span<const std::uint8_t> sides);

// "(3 17 20)": vertex ids as messages name a simplex.
std::string NameSimplex(const std::uint32_t* ids, int count);

}  // namespace stellate::core
