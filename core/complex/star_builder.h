#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/base/function_ref.h"
#include "core/base/instantiate.h"
#include "core/complex/blocks.h"
#include "core/complex/sample.h"
#include "core/geometry/restricted_voronoi_cell.h"
#include "core/specification.h"

namespace stellate::core {

// How far outwards walls are moved, as a share of the fake simplex's inradius: its corners may lie
// in the planes of walls along the axes, and rounding would decide on which side they are.
inline constexpr double kWallOffset = 1e-12;

// How the stars of a mesh are built.
struct StarOptions {
  double inradius = 0;  // of the fake simplex that each cell begins as, length
  CentreRule centre_rule = CentreRule::kTangentSpace;  // where simplices are judged
  // Boundary-only mode: stars are built only as far out as their simplices of boundary faces reach.
  // While the boundary is meshed by itself, simplices inside would reach from one side of M to the
  // other.
  bool boundary_only = false;
};

// A star that is cut by a new point.
struct StarCut {
  std::uint32_t star, by;
  bool operator<(const StarCut& other) const {
    return star != other.star ? star < other.star : by < other.by;
  }
};

// The cuts of one star. Stars are cut in the order of the first new points that cut them.
struct StarCuts {
  std::uint32_t first, star;  // the first new point that cuts the star
  std::size_t begin, end;     // its cuts
  bool operator<(const StarCuts& other) const {
    return first != other.first ? first < other.first : star < other.star;
  }
};

// Sample points around a place as (squared distance, id).
using NearPoints = std::vector<std::pair<double, std::uint32_t>>;

// Builds and cuts single stars of a sample. A star is stored as its dual, the Voronoi cell of its
// point p restricted to T_pM, and built by clipping a simplex of fake facets with the bisectors of
// p and the points around it. Pure: it writes only to its output arguments, and a star depends only
// on the sample and the options.
//
//   const StarBuilder<2> builder(sample, {.inradius = 10 * epsilon});
//   builder.Build(sample.At(p), {}, &cell, &influenced);
//   builder.Clip(sample.At(p), newcomer, nullptr, &cell);
//
// There are several ways to build a star. In tangent spaces they give the same cell and differ in
// cost. At common centres the order of the cuts may matter in a cell that is far from convex, so
// that each case has one way.
//
//   A single star, Build():
//   k   centre rule    point            way
//   2   tangent space  inside, no ball  BuildPolygon: a draft, computes each half-space once
//   3   tangent space  inside, no ball  BuildPolytope: a draft, without adjacent vertices; if
//                                       rounding spoils that, BuildAsFound
//   3   common centre  inside           BuildAsInTangentSpace: a draft, judged when it is complete;
//                                       if that is not the star, BuildNearestFirst
//   any other case                      BuildAsFound: a cell, clipped in the search tree's order
//
//   All stars of a sample together, BulkStarBuilder, which searches once for many:
//   2   tangent space  inside, no ball  a draft, clipped by the nearest points first
//   3+  common centre  inside           BuildFromNear: built in the tangent space, judged when
//                                       complete; if that is not the star, BuildNearestFirst
//   any other case                      BuildFromNear: BuildNearestFirst
//
// "Inside": on no wall and, unless k = 2, not in boundary-only mode. "No ball": the sample has no
// protecting balls.
template <int K>
class StarBuilder {
 public:
  using Cell = RestrictedVoronoiCell<K>;
  // A call search(from, to) appends the points between these distances from p.
  using Search = FunctionRef<void(double from, double to)>;

  // `sample`: borrowed, indexed.
  StarBuilder(const Sample<K>& sample, const StarOptions& options)
      : sample_(sample),
        options_(options),
        judged_radius2_(kJudgedRadius * kJudgedRadius * sample.epsilon() * sample.epsilon()) {}

  // Builds the star of p, which need not be in the sample.
  //   first       points that are likely to close the cell, in the order in which to cut by them:
  //               without these, a search that begins on one side of p visits all of that side
  //   influenced  receives the points whose stars p may cut
  void Build(const Site& p, std::span<const std::uint32_t> first, Cell* star,
             std::vector<std::uint32_t>* influenced) const;
  // Builds the star from `near`: all points within `known` of p, nearest first, without p. `search`
  // appends more of them.
  void BuildFromNear(const Site& p, double known, NearPoints* near, const Search& search,
                     Cell* star) const;

  // Clips p's star by q, and returns whether q cuts it. `born`: the star of q if it is built, in
  // which centres are looked up.
  bool Clip(const Site& p, const Site& q, const Cell* born, Cell* star) const;
  // Clips p's star by all points of `cuts`, whose stars are in `stars` by id.
  void Cut(const Site& p, std::span<const StarCut> cuts, const Blocks<Cell>& stars,
           Cell* star) const;
  // Whether q cuts p's star.
  bool IsCutBy(const Cell& star, const Site& p, const Site& q) const;

  // Returns the influence of p: how far from p a point may be that cuts its star, as far out as
  // that is built.
  double Influence(std::uint32_t p, const Cell& star) const {
    return Influence(p, options_.boundary_only ? MaxNorm2OnFaces(star) : star.max_norm2());
  }
  // Returns the same for a star with no vertex farther out than the root of `most2`.
  double Influence(std::uint32_t p, double most2) const {
    if (!sample_.has_protecting_balls()) return InfluenceWithin(most2);
    const double power2 =
        std::max(most2 - sample_.ProtectingRadius2(p) + sample_.largest_protecting_radius2(), 0.0);
    return (std::sqrt(most2) + std::sqrt(power2)) * (1 + 1e-9);
  }
  // Returns the same for a sample without protecting balls.
  static double InfluenceWithin(double most2) { return 2 * std::sqrt(most2) * (1 + 1e-9); }

  // Writes the normal of a facet's half-space in p's cell, and returns its offset.
  double HalfSpace(const Site& p, std::uint32_t id, double* normal) const;
  // The same for the bisector of p and q; also writes step = q - p, d numbers.
  double HalfSpace(const Site& p, const Site& q, double* step, double* normal) const {
    return 0.5 * (sample_.Project(p, q.point, step, normal) + sample_.Weight(p.id) -
                  sample_.Weight(q.id));
  }

  const Sample<K>& sample() const { return sample_; }
  const StarOptions& options() const { return options_; }
  // Simplices of a larger circumradius are judged in the tangent space.
  double judged_radius2() const { return judged_radius2_; }

 private:
  // In epsilon. Farther out the common centre is no better, and simplices will be refined anyway.
  static constexpr double kJudgedRadius = 1.3;

  void BuildPolygon(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                    std::vector<std::uint32_t>* influenced) const;
  bool BuildPolytope(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                     std::vector<std::uint32_t>* influenced) const;
  bool BuildAsInTangentSpace(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                             std::vector<std::uint32_t>* influenced) const;
  void BuildAsFound(const Site& p, std::span<const std::uint32_t> first, Cell* star,
                    std::vector<std::uint32_t>* influenced) const;
  void BuildNearestFirst(const Site& p, Cell* star) const;
  void BuildNearestFirst(const Site& p, double known, NearPoints* near, const Search& search,
                         Cell* star) const;
  bool BuildInTangentSpace(const Site& p, double* known, NearPoints* near, const Search& search,
                           Cell* star) const;
  std::size_t CutInTangentSpace(const Site& p, double* known, NearPoints* near,
                                const Search& search, Cell* star) const;
  template <typename Reach, typename ClipBy>
  void ClipAsFound(const Site& p, std::span<const std::uint32_t> first, const Reach& reach_now,
                   const ClipBy& clip, std::vector<std::uint32_t>* influenced) const;
  void CloseInTangentSpace(const Site& p, Cell* star) const;
  void CutPolygon(const Site& p, std::span<const StarCut> cuts, Cell* star) const;

  void Reset(const Site& p, Cell* star) const;
  void ResetInTangentSpace(const Site& p, Cell* star) const;
  bool ClipInTangentSpace(const Site& p, const Site& q, Cell* star) const;
  template <typename Polytope>
  bool ClipApart(const Site& p, std::uint32_t q, double* step, Polytope* polytope) const;
  bool Judge(const Site& p, const NearPoints& near, std::size_t projected, Cell* star) const;
  static double MaxNorm2OnFaces(const Cell& star);
  static typename Cell::Scratch& ThreadScratch();

  const Sample<K>& sample_;
  StarOptions options_;
  double judged_radius2_;
};

STELLATE_DECLARE_CLASS(StarBuilder)

}  // namespace stellate::core
