#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/geometry/half_spaces.h"
#include "core/geometry/surroundings.h"

namespace stellate::core {

// A RestrictedVoronoiCell<3> while it is being clipped in the tangent space. A vertex is stored as
// its three facets alone; adjacent vertices are found once, when the polytope is complete. The
// polytope is the same as by that class's own cuts, bit for bit, vertex by vertex and facet by
// facet. A cut that does not remove a topological disc of the boundary (because of rounding) cannot
// be represented: gave_up() becomes true.
//
//   DraftPolytope& polytope = ThreadPolytope();
//   polytope.Reset(inradius);
//   for (q ...) polytope.Clip(q, normal, offset);
//   if (!polytope.gave_up()) cell.Take(polytope);
class DraftPolytope {
 public:
  static constexpr std::size_t kMostFacets = 64;  // a bit each
  static constexpr std::size_t kMostVertices = 2 * kMostFacets;

  struct Facet {
    double normal[3];
    double offset;
    std::uint32_t id;
  };
  using Corner = std::array<std::uint8_t, 3>;  // the facets of a vertex, in the order of its slots

  // Begins with a regular tetrahedron of fake facets at distance `inradius` from p.
  void Reset(double inradius);

  // Clips as RestrictedVoronoiCell<3>::Clip does. Returns false for every cut once it gave up.
  bool Clip(std::uint32_t id, const double* normal, double offset);

  bool gave_up() const { return gave_up_; }
  double max_norm2() const { return max_norm2_; }  // 0 if it gave up

  std::size_t facet_count() const { return facet_count_; }
  const Facet& facet(std::size_t f) const { return facets_[f]; }
  std::size_t vertex_count() const { return vertex_count_; }
  const Corner& corner(std::size_t v) const { return corners_[v]; }
  void CopyPlace(std::size_t v, double* to) const { to[0] = x_[v], to[1] = y_[v], to[2] = z_[v]; }
  double norm2(std::size_t v) const { return norm2_[v]; }

 private:
  using Facets = std::uint64_t;  // a bit each
  struct Crossing {
    std::uint8_t first, second;  // the facets of the edge that the cut crosses
    std::uint8_t removed;        // the end that goes
  };

  static Facets Bit(std::size_t facet) { return Facets{1} << facet; }
  std::size_t FindRemoved(const double* normal, double offset);
  Facets FindCrossings(std::size_t removed);
  bool IsCircle() const;
  void Locate(std::size_t v, const Crossing& crossing);
  std::size_t KeptEnd(const Crossing& crossing) const;
  void MoveVertex(std::size_t from, std::size_t to);
  void DropFacet(std::size_t f);
  bool GiveUp();

  double inradius_ = 0;
  Facet fake_[4];  // the tetrahedron that it begins with
  double max_norm2_ = 0;
  bool gave_up_ = false;
  std::size_t facet_count_ = 0, vertex_count_ = 0, crossing_count_ = 0;
  // Vertices by coordinate: a half-space is compared with two in one instruction.
  double x_[kMostVertices], y_[kMostVertices], z_[kMostVertices];
  double norm2_[kMostVertices], excess_[kMostVertices];
  Corner corners_[kMostVertices];
  Facet facets_[kMostFacets];
  // Working memory of the last cut.
  std::uint8_t removed_[kMostVertices];
  Crossing crossings_[kMostVertices];
  Facets across_[kMostFacets];  // by facet, those that it shares a crossed edge with
};

// Returns the thread's own polytope, for reuse. It is on the heap: a thread's static variables lie
// on its stack, and the threads of other libraries, which never come here, may have little of that.
DraftPolytope& ThreadPolytope();

}  // namespace stellate::core
