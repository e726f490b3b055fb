#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/sample/random.h"
#include "core/sample/vector_ops.h"

namespace stellate::core {

// Ids of the facets that bound a cell before its neighbours are known.
inline constexpr std::uint32_t kFirstFakeId = 0xfffffff0u;
inline constexpr bool IsFake(std::uint32_t id) { return id >= kFirstFakeId; }

// The Voronoi cell of a sample point p restricted to T_pM (Lemma 2.4.2), in tangent coordinates
// with p at the origin:
//
//   V(p) = { x in R^K : normal_q . x <= offset_q  for all q },
//   normal_q = T_p^t (q - p),  offset_q = |q - p|^2 / 2  (plus the perturbing weights).
//
// A simple polytope: each vertex lies on exactly K facets and has K neighbours; it is dual to the
// k-simplex of star(p) on p and the K facets' points, and is that simplex's circumcentre c_p in
// T_pM. Kept by clipping, one half-space at a time; what is cut off is found by walking, and a cut
// that rounding makes impossible is refused, so that the combinatorics stay those of a polytope.
template <int K>
class RestrictedVoronoiCell {
 public:
  using Index = std::uint16_t;

  struct Facet {
    double normal[K];  // length
    double offset;     // length squared
    std::uint32_t id;  // sample point, or fake
    Index vertices;    // how many lie on it
  };

  struct Vertex {
    double x[K];        // c_p(sigma), tangent coordinates
    double norm2;       // R_p(sigma)^2
    std::uint64_t key;  // sum of Mix64 over the facets' ids: tells simplices apart quickly
    Index facet[K];     // into facets()
    Index adjacent[K];  // the vertex on all facets but facet[i]
    bool judged;        // not at its place in T_pM
  };

  // Working memory of Clip, one a thread.
  struct Scratch {
    std::vector<double> excess;
    std::vector<std::uint8_t> cut, seen;
    std::vector<Index> stack, removed, crossed;
    struct Crossing {
      Index kept, kept_slot, removed, slot;
    };  // an edge and its place at both ends
    std::vector<Crossing> crossings;
    std::vector<std::vector<Index>> pieces;
  };

  // Where the vertices are judged. Without one, at their place in T_pM: the cell is the convex
  // polytope of Lemma 2.4.2. With one, at a centre in R^d that depends on the dual simplex alone:
  // the cell is then a polytope in its combinatorics only.
  class Judge {
   public:
    virtual ~Judge() = default;
    virtual int d() const = 0;
    // Writes the centre of v, relative to p (d numbers); sets v.norm2 to its squared norm and v.x
    // to its tangent coordinates. False, and nothing written, where v stays at its place in T_pM.
    virtual bool Centre(const RestrictedVoronoiCell& cell, Vertex& v, double* centre) const = 0;
    // Writes v's place in T_pM, relative to p (d numbers).
    virtual void Lift(const Vertex& v, double* centre) const = 0;
  };

  // A regular simplex of K+1 fake facets at distance `inradius` from p.
  void Reset(double inradius, const Judge* judge = nullptr);

  // Cuts away { x : normal . x > offset }. Returns whether anything was cut. A half-space that
  // would cut everything away (it cannot, for offset > 0, but in rounding) is refused. With a
  // judge, the same one for the cell's whole life, `step` is q - p (d numbers), and what is cut
  // away is { c : step . c > offset }; a cut that would leave no polytope is refused too.
  bool Clip(std::uint32_t id, const double* normal, double offset, Scratch& scratch,
            const Judge* judge = nullptr, const double* step = nullptr);

  // Whether Clip with these arguments would cut: some vertex violates the half-space.
  bool WouldCut(const double* normal, double offset, const Judge* judge = nullptr,
                const double* step = nullptr) const {
    for (std::size_t v = 0; v < vertices_.size(); ++v)
      if (Excess(v, normal, offset, judge, step) > 0) return true;
    return false;
  }

  // Whether Clip with these arguments would cut vertex v off.
  bool WouldCutVertex(std::size_t v, const double* normal, double offset,
                      const Judge* judge = nullptr, const double* step = nullptr) const {
    return Excess(v, normal, offset, judge, step) > 0;
  }

  // Of a cell with a judge, of dimension d: the centre of vertex v, relative to p.
  const double* Centre(std::size_t v, int d) const {
    return centres_.data() + v * static_cast<std::size_t>(d);
  }

  const std::vector<Facet>& facets() const { return facets_; }
  const std::vector<Vertex>& vertices() const { return vertices_; }

  // max R_p, squared. A point farther from p than twice its root cannot matter.
  double max_norm2() const { return max_norm2_; }
  bool bounded() const { return !has_fake_; }  // no fake facet is left

  bool HasFakeFacet(const Vertex& v) const {
    for (Index f : v.facet)
      if (IsFake(facets_[f].id)) return true;
    return false;
  }

 private:
  double Excess(std::size_t v, const double* normal, double offset, const Judge* judge,
                const double* step) const {
    if (judge) {
      const int d = judge->d();
      return Dot(step, Centre(v, d), d) - offset;
    }
    double s = -offset;
    for (int a = 0; a < K; ++a) s += normal[a] * vertices_[v].x[a];
    return s;
  }
  void Locate(Vertex& v, const Vertex& kept, const Vertex& removed, double s, double t,
              double slack) const;
  void SetKey(Vertex& v) const;
  bool ClipPolygon(const Facet& facet, std::size_t worst, Scratch& scratch) requires(K == 2);
  bool Tidy(Scratch& scratch) const;
  bool Stitch(const Scratch& scratch, std::size_t old_count);
  void DropVertex(std::size_t v, std::size_t d);
  void DropFacets();
  void Measure();

  std::vector<Facet> facets_;
  std::vector<Vertex> vertices_;
  std::vector<double> centres_;  // by vertex, d each, relative to p; empty without a judge
  double max_norm2_ = 0;
  bool has_fake_ = true;
};

extern template class RestrictedVoronoiCell<1>;
extern template class RestrictedVoronoiCell<2>;
extern template class RestrictedVoronoiCell<3>;
extern template class RestrictedVoronoiCell<4>;
extern template class RestrictedVoronoiCell<5>;

}  // namespace stellate::core
