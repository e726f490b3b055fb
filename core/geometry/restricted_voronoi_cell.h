#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/parcel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/geometry/facet_ids.h"
#include "core/geometry/restricted_voronoi_polygon.h"
#include "core/geometry/surroundings.h"

namespace stellate::core {

class DraftPolytope;

// The Voronoi cell of a sample point p restricted to T_pM (Lemma 2.4.2), in tangent coordinates
// with p at the origin:
//
//   V(p) = { x in R^K : normal_q . x <= offset_q  for all q },
//   normal_q = T_p^t (q - p),  offset_q = |q - p|^2 / 2  (plus the perturbing weights).
//
// A simple polytope: each vertex lies on exactly K facets and has K neighbours; it is dual to the
// k-simplex of star(p) on p and the K facets' points, and is that simplex's circumcentre c_p in
// T_pM. At a point of the boundary the cell is also cut by its walls' conormal half-spaces: facets
// with offset 0, whose vertices are dual to simplices of the faces.
//
//   RestrictedVoronoiCell<3> cell;
//   cell.Reset(inradius, around);
//   for (q ...) cell.Clip(q, normal, offset, scratch, around);
//   for (std::size_t v = 0; v < cell.vertex_count(); ++v) Use(cell.x(v));
//
// The part that a half-space cuts off is found by walking from vertex to vertex. A cut that
// rounding makes impossible is refused, so that the combinatorics stay those of a polytope.
// Vertices and facets are numbered from 0; a cut may change their numbers. For K = 2 the same cell
// takes less memory: restricted_voronoi_polygon.h.
template <int K>
class RestrictedVoronoiCell {
 public:
  using Index = std::uint16_t;

  // Working memory of Clip, one for each thread.
  struct Scratch {
    std::vector<double> excess;
    std::vector<std::uint8_t> cut, seen;
    std::vector<Index> removed, crossed;
    struct Crossing {
      Index kept, kept_slot, removed, slot;
    };  // an edge and its place at both ends
    std::vector<Crossing> crossings;
    std::vector<std::array<Index, 2>> on_facet;  // the crossings on each facet, where they are two
    std::vector<std::vector<Index>> pieces;
  };

  // Begins with a regular simplex of K+1 fake facets at distance `inradius` from p.
  void Reset(double inradius, const Surroundings<K>& around);

  // Becomes a polytope that was clipped as a draft in the tangent space; no vertex is judged.
  // REQUIRES: K = 3, and it did not give up.
  void Take(const DraftPolytope& polytope);

  // Cuts away { x : normal . x > offset }. Returns whether anything was cut. A half-space that
  // would cut everything away (for offset > 0 only rounding can do that) is refused. If vertices
  // are judged, `step` is q - p (d numbers), and { c : step . c > offset } is cut away; a cut that
  // would leave no polytope is refused, too. `around`: the same for the cell's whole life.
  bool Clip(std::uint32_t id, const double* normal, double offset, Scratch& scratch,
            const Surroundings<K>& around, const double* step = nullptr);

  // Judges the vertices of a cell that was clipped in T_pM at their common centres, from now on, if
  // `around` has such.
  void Judge(const Surroundings<K>& around);

  // Appends it to a message, and becomes what was packed.
  void PackTo(std::vector<std::byte>* message) const;
  void Unpack(Parcel* parcel);

  // Whether Clip with these arguments would cut: some vertex violates the half-space.
  bool WouldCut(const double* normal, double offset, const double* step = nullptr) const {
    if (d_ == 0) {
      for (const Vertex& v : vertices_)
        if (Dot(normal, v.x, K) - offset > 0) return true;
      return false;
    }
    return WithDimension(static_cast<int>(d_), [&](auto known) {
      const int d = known() > 0 ? known() : static_cast<int>(d_);
      const double* centre = centres_.data();
      for (std::size_t v = 0; v < vertices_.size(); ++v, centre += d)
        if (Dot(step, centre, d) - offset > 0) return true;
      return false;
    });
  }

  // Whether Clip with these arguments would cut vertex v off.
  bool WouldCutVertex(std::size_t v, const double* normal, double offset,
                      const double* step = nullptr) const {
    return Excess(v, normal, offset, step) > 0;
  }

  std::size_t facet_count() const { return facets_.size(); }
  std::uint32_t id(std::size_t facet) const {
    return facets_[facet].id;
  }  // IsSample, IsWall, IsFake
  const double* normal(std::size_t facet) const { return facets_[facet].normal; }  // length
  double offset(std::size_t facet) const { return facets_[facet].offset; }         // length squared

  std::size_t vertex_count() const { return vertices_.size(); }
  const double* x(std::size_t v) const { return vertices_[v].x; }   // c_p, tangent coordinates
  double norm2(std::size_t v) const { return vertices_[v].norm2; }  // R_p^2
  // Returns the sum of Mix64 over the facets' ids, which distinguishes simplices quickly.
  std::uint64_t key(std::size_t v) const { return keys_[v]; }
  // The first vertex from `from` on with that key; vertex_count() if there is none.
  std::size_t Find(std::uint64_t key, std::size_t from = 0) const {
    return static_cast<std::size_t>(
        std::find(keys_.begin() + static_cast<std::ptrdiff_t>(from), keys_.end(), key) -
        keys_.begin());
  }
  Index facet(std::size_t v, int slot) const { return vertices_[v].facet[slot]; }
  // The vertex on all facets of v but that one.
  Index adjacent(std::size_t v, int slot) const { return vertices_[v].adjacent[slot]; }
  // Whether v is at a common centre, and not at its place in T_pM.
  bool judged(std::size_t v) const { return vertices_[v].judged; }
  // Returns the centre of v, relative to p. REQUIRES: the cell's vertices are judged.
  const double* Centre(std::size_t v) const { return centres_.data() + v * d_; }

  // max R_p, squared. A point farther from p than twice its root cannot matter.
  double max_norm2() const { return max_norm2_; }
  bool bounded() const { return !has_fake_; }  // no fake facet is left

  bool HasFakeFacet(std::size_t v) const {
    for (const Index f : vertices_[v].facet)
      if (IsFake(facets_[f].id)) return true;
    return false;
  }

 private:
  struct Facet {
    double normal[K];
    double offset;
    std::uint32_t id;
    Index vertices;  // how many lie on it
  };
  struct Vertex {
    double x[K];
    double norm2;
    Index facet[K];
    Index adjacent[K];
    bool judged;
  };

  double Excess(std::size_t v, const double* normal, double offset, const double* step) const {
    return (d_ > 0 ? Dot(step, Centre(v), static_cast<int>(d_)) : Dot(normal, vertices_[v].x, K)) -
           offset;
  }
  // Writes the excess of each vertex, returns the place of the largest.
  std::size_t Excesses(const double* normal, double offset, const double* step,
                       double* excess) const;
  void Locate(Vertex& v, const Vertex& kept, const Vertex& removed, double s, double t,
              double slack) const;
  std::uint64_t KeyOf(const Vertex& v) const;
  void FindCrossings(Scratch& scratch) const;
  bool IsDisc(Scratch& scratch) const;
  bool Tidy(Scratch& scratch) const;
  void Match(const Scratch& scratch, std::size_t old_count);
  bool Stitch(const Scratch& scratch, std::size_t old_count);
  void DropVertex(std::size_t v);
  void DropFacets();
  void Measure();

  std::vector<Facet> facets_;
  std::vector<Vertex> vertices_;
  std::vector<std::uint64_t> keys_;  // by vertex, in an array of their own, which Find reads
  std::vector<double> centres_;      // by vertex, d_ each, relative to p
  std::size_t d_ = 0;                // 0: vertices are at their places in T_pM
  double max_norm2_ = 0;
  bool has_fake_ = true;
};

template <>
void RestrictedVoronoiCell<3>::Take(const DraftPolytope& polytope);

extern template class RestrictedVoronoiCell<1>;
extern template class RestrictedVoronoiCell<3>;
extern template class RestrictedVoronoiCell<4>;  // of 3-manifolds, too: their weighted stars
STELLATE_ABOVE_3(extern template class RestrictedVoronoiCell<5>;)

// Returns the walls that vertex v of a cell is on.
template <int K>
WallSet WallsAt(const RestrictedVoronoiCell<K>& cell, std::size_t v) {
  WallSet walls = 0;
  for (int s = 0; s < K; ++s)
    if (const std::uint32_t id = cell.id(cell.facet(v, s)); IsWall(id))
      walls |= SetOfWall(WallOf(id));
  return walls;
}

}  // namespace stellate::core
