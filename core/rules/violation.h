#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/geometry/restricted_voronoi_cell.h"
#include "core/walls.h"

namespace stellate::core {

// The refinement rules of Sec. 5.3.5, in their order, and R5, that of Chapter 8.
enum class Rule : std::uint8_t { kSize = 0, kRadiusEdge, kShape, kInconsistent, kProtection };

// A simplex of star(p) that breaks a rule, or that must be split to protect its face;
// given by its dual vertex in p's cell.
template <int K>
struct Violation {
  Rule rule = Rule::kSize;
  double radius = 0;        // R_p(sigma), length
  double x[K] = {};         // c_p(sigma) in p's tangent coordinates
  std::size_t vertex = 0;   // of p's cell; valid until that changes
  int sector = 0;           // whose cell that is (Stars::cell)
  bool fake = false;        // not a simplex yet: the cell is unbounded there
  bool tilted = false;      // R3: not a sliver, but tilted too far for a proof
  bool sharp = false;       // R3: not a sliver, but has a sharp dihedral angle
  WallSet walls = 0;        // of the face that the simplex is one of
  int codimension = 0;      // of that face
  bool encroached = false;  // breaks no rule, but a point off its face would come too near

  int dimension() const { return K - codimension; }
};

// Returns the violation by the simplex dual to vertex v of p's cell.
template <int K>
Violation<K> ViolationAt(Rule rule, const RestrictedVoronoiCell<K>& cell, std::size_t v,
                         bool fake = false, int sector = 0) {
  Violation<K> violation;
  violation.vertex = v;
  violation.sector = sector;
  violation.rule = rule;
  violation.radius = std::sqrt(cell.norm2(v));
  std::copy_n(cell.x(v), K, violation.x);
  violation.fake = fake;
  return violation;
}

// Finds the worst vertex of a cell, by a measure of each. Of two that are equally bad it takes the
// one whose simplex has the lower ids: the order of a cell's vertices depends on the order of its
// cuts.
//
//   WorstVertex<K> worst(cell);
//   for (...) if (breaks(v) && worst.IsBeatenBy(v, badness(v))) worst.Take(v, badness(v));
template <int K>
class WorstVertex {
 public:
  explicit WorstVertex(const RestrictedVoronoiCell<K>& cell) : cell_(cell) {}

  bool is_any() const { return is_any_; }
  std::size_t vertex() const { return vertex_; }  // REQUIRES: is_any()
  bool IsBeatenBy(std::size_t v, double badness) const {
    if (!is_any_ || badness != badness_) return !is_any_ || badness > badness_;
    return IdsAt(v) < IdsAt(vertex_);
  }
  void Take(std::size_t v, double badness) {
    is_any_ = true;
    vertex_ = v;
    badness_ = badness;
  }

 private:
  std::array<std::uint32_t, K> IdsAt(std::size_t v) const {
    std::array<std::uint32_t, K> ids;
    for (int s = 0; s < K; ++s) ids[static_cast<std::size_t>(s)] = cell_.id(cell_.facet(v, s));
    std::sort(ids.begin(), ids.end());
    return ids;
  }

  const RestrictedVoronoiCell<K>& cell_;
  bool is_any_ = false;
  std::size_t vertex_ = 0;
  double badness_ = 0;
};

}  // namespace stellate::core
