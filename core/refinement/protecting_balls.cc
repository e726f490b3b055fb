#include "core/refinement/protecting_balls.h"

#include <algorithm>
#include <cmath>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/vector_ops.h"
#include "core/boundary/sharp_edges.h"

namespace stellate::core {
namespace {

// Lenses of 56 degrees and more were seen to close without balls, 0 of 108 refused; of thinner ones
// of 50 to 54 degrees 14 of 108 were, as points crowd at the edge. An edge that is sharper
// somewhere gets balls along it up to the second angle: the sharpest point without a ball should
// not lie next to a ball. Neither is an angle at which people let walls meet (45, 50, 54.7,
// 60, 70.5): rounding would tell which edges are below it.
constexpr double kNeedsBall = 0.52991926423320490;       // cosine of 58 degrees
constexpr double kProtectedBelow = 0.34202014332566873;  // of 70
constexpr double kOtherEdge = 1.0 / 3;
constexpr double kOtherPoint = 0.9;  // of the distance to points inside of faces
// The sum of the radii at the ends of an edge at a corner, as a share of its length: there the
// balls must only touch.
constexpr double kMeet = 1;
constexpr double kSplitsPerOctave = 20;

template <int K>
bool IsSharp(const Stars<K>& stars, std::uint32_t p, double cosine) {
  const auto angle = SharpestAt<K>(stars, p);
  return angle && angle->cosine > cosine;
}

template <int K>
bool IsCorner(const Stars<K>& stars, std::uint32_t p) {
  return stars.sample().Codimension(stars.sample().walls(p)) >= K;
}

// An edge of the mesh of edges, seen from one end.
template <int K>
struct HalfEdge {
  typename Stars<K>::CellVertex at;
  std::uint32_t other;
};

template <int K>
std::vector<HalfEdge<K>> EdgesAt(const Stars<K>& stars, std::uint32_t p) {
  std::vector<HalfEdge<K>> edges;
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
    const auto& cell = stars.cell(p, sector);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const auto simplex = stars.FaceSimplexOf(p, cell, v);
      if (simplex.dimension() != 1 || simplex.fake || simplex.foreign || simplex.count != 2 ||
          stars.sample().sectors().Piece(p, sector, simplex.walls) == 0)
        continue;
      const std::uint32_t other = simplex.ids[simplex.ids[0] == p];
      // Several sectors share an edge.
      if (std::none_of(edges.begin(), edges.end(), [&](const auto& e) { return e.other == other; }))
        edges.push_back({{p, v, sector}, other});
    }
  }
  return edges;
}

// Returns the largest radius of a ball around p that keeps clear of everything not along its own
// edge.
template <int K>
double ClearanceAt(const Stars<K>& stars, std::uint32_t p, double bound) {
  double clearance = kLargestBall * bound;
  stars.sample().ForEachWithin(
      stars.sample().Point(p), clearance / kOtherEdge, [&](std::uint32_t q) {
        if (q == p) return;
        const double distance =
            Distance(stars.sample().Point(p), stars.sample().Point(q), stars.sample().d());
        const WallSet there = stars.sample().walls(q);
        if (CountWalls(there) < 2)
          clearance = std::min(clearance, kOtherPoint * distance);
        else if (CountWalls(there & stars.sample().walls(p)) < 2)  // not along the same edge
          clearance = std::min(clearance, kOtherEdge * distance);
      });
  return clearance;
}

template <int K>
double LengthOf(const Stars<K>& stars, std::uint32_t p, std::uint32_t q) {
  return Distance(stars.sample().Point(p), stars.sample().Point(q), stars.sample().d());
}

}  // namespace

template <int K>
ProtectingBalls<K> PlanProtectingBalls(const Stars<K>& stars, const SizeField<K>& sizes) {
  ProtectingBalls<K> balls;
  std::vector<std::uint32_t> sharp;
  for (const std::uint32_t p : stars.sample().boundary()) {
    CheckInterruption(p);
    if (stars.sample().ProtectingRadius2(p) > 0 || IsSharp<K>(stars, p, kProtectedBelow))
      sharp.push_back(p);
  }
  balls.radii2.assign(stars.size(), 0);
  balls.least_clearance = INFINITY;
  std::vector<std::vector<HalfEdge<K>>> edges;
  for (const std::uint32_t p : sharp) {
    CheckInterruption(edges.size());
    edges.push_back(EdgesAt<K>(stars, p));
    balls.radii2[p] = stars.sample().ProtectingRadius2(p);
    if (balls.radii2[p] > 0) continue;
    double radius = ClearanceAt<K>(stars, p, sizes.BoundAt(stars, p));
    balls.least_clearance = std::min(balls.least_clearance, radius);
    for (const HalfEdge<K>& edge : edges.back())
      radius = std::min(radius, kBallShare * LengthOf<K>(stars, p, edge.other));
    balls.radii2[p] = radius * radius;
  }
  for (std::size_t i = 0; i < sharp.size(); ++i)
    for (const HalfEdge<K>& edge : edges[i]) {
      const std::uint32_t p = sharp[i], q = edge.other;
      if (q < p || balls.radii2[q] == 0) continue;
      const double length = LengthOf<K>(stars, p, q);
      ++balls.edges;
      balls.longest = std::max(balls.longest, length);
      balls.least_clearance = std::min(balls.least_clearance, length);
      if (stars.sample().ProtectingRadius2(p) > 0 && stars.sample().ProtectingRadius2(q) > 0)
        continue;
      const double overlap = IsCorner<K>(stars, p) || IsCorner<K>(stars, q) ? kMeet : kBallOverlap;
      if (std::sqrt(balls.radii2[p]) + std::sqrt(balls.radii2[q]) < overlap * length)
        balls.gaps.push_back(edge.at);
    }
  return balls;
}

template <int K>
std::size_t MostSplits(const ProtectingBalls<K>& balls) {
  if (balls.edges == 0) return 0;
  int octaves = 1;
  for (double length = balls.least_clearance; length < balls.longest; length *= 2) ++octaves;
  return static_cast<std::size_t>(kSplitsPerOctave * octaves) * balls.edges;
}

template <int K>
bool NeedsProtection(const Stars<K>& stars) {
  const std::vector<std::uint32_t>& boundary = stars.sample().boundary();
  return std::any_of(boundary.begin(), boundary.end(), [&](std::uint32_t p) {
    return stars.sample().ProtectingRadius2(p) == 0 && IsSharp<K>(stars, p, kNeedsBall);
  });
}

#define STELLATE_EACH(K)                                                                    \
  template ProtectingBalls<K> PlanProtectingBalls<K>(const Stars<K>&, const SizeField<K>&); \
  template std::size_t MostSplits<K>(const ProtectingBalls<K>&);                            \
  template bool NeedsProtection<K>(const Stars<K>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
