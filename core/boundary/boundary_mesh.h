#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/complex/stars.h"
#include "core/report.h"

namespace stellate::core {

// A simplex of the boundary, or of what is between two regions: of the face of one wall.
template <int K>
struct BoundarySimplex {
  std::array<std::uint32_t, K> ids;  // ascending
  int wall = 0;
  WallSet signs = 0;  // of all other walls, in an arrangement; else of no meaning
  // The labels that the normal of the row of ids points away from and into; where M does not fill
  // space, those of the wall's positive and negative side.
  std::int8_t behind = 0, ahead = 0;

  bool operator==(const BoundarySimplex&) const = default;
};

// Returns the boundary's simplices, and those between regions, sorted by their ids.
template <int K>
std::vector<BoundarySimplex<K>> BoundarySimplices(const Stars<K>& stars);

// Writes the outward conormals of a wall at the vertices of a simplex of it, d each: they point to
// the wall's negative side.
template <int K>
void ConormalsAt(const Sample<K>& sample, const BoundarySimplex<K>& simplex, double* conormals);

// Returns the largest squared circumradius R_p of a simplex of the boundary in the stars of a
// point.
template <int K>
double MaxBoundaryNorm2(const Stars<K>& stars, std::uint32_t p);

// The mesh that a run of the boundary alone hands out, as it grows.
template <int K>
class BoundaryMesh {
 public:
  // Takes the boundary as the stars have it now, and adds the change to a delta.
  void Update(const Stars<K>& stars, MeshDelta* delta);

  std::uint64_t size() const { return simplices_.size(); }
  std::vector<std::uint32_t> Simplices() const;  // K ids each
  std::vector<std::int8_t> Labels() const;       // two each: behind, ahead

 private:
  std::vector<BoundarySimplex<K>> simplices_;
};

STELLATE_DECLARE_CLASS(BoundaryMesh)

}  // namespace stellate::core
