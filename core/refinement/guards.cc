#include "core/refinement/guards.h"

#include <algorithm>
#include <cmath>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/refinement/sharp_edges.h"

namespace stellate::core {
namespace {

// Wedges and corners of 50 degrees were seen to close without guards, of 40 not. An edge that is
// sharper somewhere is guarded up to the second of these along it: beside a guard there should not
// lie the sharpest of what has none.
constexpr double kNeedsGuard = 50;
constexpr double kGuardedBelow = 70;
// Of the size asked for. A simplex at a guarded point p is measured from p, beyond its ball.
constexpr double kLargest = 0.6;
constexpr double kOtherEdge = 1.0 / 3;
constexpr double kOtherPoint = 0.9;  // of the distance to points inside of faces
// Of the distance to the nearest neighbour along the edge. That of a corner reaches nearly as far
// as its collar, whatever the balls there are.
constexpr double kNeighbour = 0.75;
constexpr double kCornerShare = 0.95;
// Of an edge's length, the sum of the radii at its ends: with the least there is a neck a third of
// the edge wide between them. At a corner they only have to meet.
constexpr double kOverlap = 1.3;
constexpr double kMeet = 1;

template <int K>
bool IsSharp(const StarComplex<K>& complex, std::uint32_t p, double degrees) {
  const auto angle = SharpestAt<K>(complex, p);
  return angle && angle->degrees < degrees;
}

template <int K>
bool IsCorner(const StarComplex<K>& complex, std::uint32_t p) {
  return CountWalls(complex.walls(p)) == K;
}

// An edge of the mesh of edges, seen from one end.
template <int K>
struct HalfEdge {
  typename StarComplex<K>::CellVertex at;
  std::uint32_t other;
};

template <int K>
std::vector<HalfEdge<K>> EdgesAt(const StarComplex<K>& complex, std::uint32_t p) {
  std::vector<HalfEdge<K>> edges;
  const auto& cell = complex.cell(p);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const auto simplex = complex.FaceSimplexOf(p, cell, v);
    if (simplex.dimension() != 1 || simplex.fake || simplex.foreign || simplex.count != 2) continue;
    edges.push_back({{p, v}, simplex.ids[simplex.ids[0] == p]});
  }
  return edges;
}

template <int K>
double RadiusAt(const StarComplex<K>& complex, std::uint32_t p,
                const std::vector<HalfEdge<K>>& edges, double bound) {
  double radius = kLargest * bound;
  const auto distance = [&](std::uint32_t q) {
    return Distance(complex.Point(p), complex.Point(q), complex.d());
  };
  for (const HalfEdge<K>& edge : edges)
    radius = std::min(radius,
                      (IsCorner<K>(complex, p) ? kCornerShare : kNeighbour) * distance(edge.other));
  complex.ForEachWithin(complex.Point(p), radius / kOtherEdge, [&](std::uint32_t q) {
    if (q == p) return;
    const WallSet there = complex.walls(q);
    if (CountWalls(there) < 2)
      radius = std::min(radius, kOtherPoint * distance(q));
    else if (CountWalls(there & complex.walls(p)) < 2)  // not along the same edge
      radius = std::min(radius, kOtherEdge * distance(q));
  });
  return radius;
}

}  // namespace

template <int K>
Guards<K> PlanGuards(const StarComplex<K>& complex, const SizeField<K>& sizes) {
  Guards<K> guards;
  std::vector<std::uint32_t> sharp;
  for (std::uint32_t p = 0; p < complex.size(); ++p) {
    CheckInterruption(p);
    if (IsSharp<K>(complex, p, kGuardedBelow)) sharp.push_back(p);
  }
  std::vector<double> radii(complex.size(), 0);
  std::vector<std::vector<HalfEdge<K>>> edges;
  for (const std::uint32_t p : sharp) {
    CheckInterruption(edges.size());
    edges.push_back(EdgesAt<K>(complex, p));
    radii[p] = RadiusAt<K>(complex, p, edges.back(), sizes.BoundAt(complex, p));
  }
  for (std::size_t i = 0; i < sharp.size(); ++i)
    for (const HalfEdge<K>& edge : edges[i]) {
      const std::uint32_t p = sharp[i], q = edge.other;
      if (q < p || radii[q] == 0) continue;
      const double overlap = IsCorner<K>(complex, p) || IsCorner<K>(complex, q) ? kMeet : kOverlap;
      const double length = Distance(complex.Point(p), complex.Point(q), complex.d());
      if (radii[p] + radii[q] < overlap * length) guards.gaps.push_back(edge.at);
    }
  for (double& radius : radii) radius *= radius;
  guards.radii2 = std::move(radii);
  return guards;
}

template <int K>
bool LacksGuards(const StarComplex<K>& complex) {
  for (std::uint32_t p = 0; p < complex.size(); ++p)
    if (complex.GuardOf(p) == 0 && IsSharp<K>(complex, p, kNeedsGuard)) return true;
  return false;
}

#define STELLATE_EACH(K)                                                        \
  template Guards<K> PlanGuards<K>(const StarComplex<K>&, const SizeField<K>&); \
  template bool LacksGuards<K>(const StarComplex<K>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
