#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/certificate/complex/local_link.h"
#include "core/certificate/complex/small_index.h"
#include "core/certificate/measure/shape.h"
#include "core/certificate/measure/star_geometry.h"
#include "core/certificate/measure/tangent_solve.h"
#include "core/geometry/reach_bound.h"
#include "core/report.h"

namespace stellate::core {

// The pass over the stars of a mesh that star_geometry.h makes.

// Edges shorter than this share of the longest at a vertex show the oracle's noise more than
// curvature.
inline constexpr double kTellingEdge = 0.5;
// A solution this little below zero, beside its largest entry, still counts as a hit of the ray.
inline constexpr double kRayTolerance = 1e-12;
// LocalLink decides up to this k.
inline constexpr int kMostLocal = 3;
inline constexpr const char* kFolded = "folds over itself in its tangent space";

// The inputs and results that all parts of the vertices share.
struct Sweep {
  const MeshView& mesh;
  const VertexStars& stars;
  const Adjacency* adjacency;                // none: all stars must embed
  std::span<const std::int8_t> orientation;  // empty when it does not help
  ShapeSearch shape;
  std::vector<double> longest_edge;  // by vertex
  // Without an adjacency, as ComputeConnectivity has them; and whether some star does not embed.
  std::vector<std::uint8_t> sides;
  std::atomic<bool> is_refuted = false;
};

// The result for some of the vertices.
struct PartOfStars {
  StarGeometry stars;
  ShapeSearch::Extremes shape;
  std::uint64_t neighbours = 0;  // of the vertices, in all
  std::uint64_t unused = 0;      // vertices
};

// Measures the stars of the vertices from `begin` to `end`, one thread's part of the pass.
template <int K>
class StarMeasurer {
 public:
  StarMeasurer(Sweep& sweep, PartOfStars* part)
      : sweep_(sweep),
        mesh_(sweep.mesh),
        stars_(sweep.stars),
        ids_(sweep.stars.list().ids->data()),
        part_(*part),
        result_(part->stars) {
    result_.reach = std::numeric_limits<double>::infinity();
  }

  void Run(std::size_t begin, std::size_t end) {
    WithDimension(mesh_.d, [&](auto known) {
      const int d = known() > 0 ? known() : mesh_.d;
      for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) {
        if (stars_.Star(p).empty()) {
          if (mesh_.IsUnused(p))
            ++part_.unused;
          else if (!sweep_.adjacency)
            sweep_.is_refuted = true;
          continue;
        }
        Project(p, d);
        MeasureReach(p);
        MeasureShapes(p, d);
        if (sweep_.adjacency)
          Judge(p);
        else if (!Embeds(p))
          sweep_.is_refuted = true;
        if (sweep_.is_refuted) return;
      }
    });
    part_.shape = shapes_.found;
  }

 private:
  static constexpr int kUsualDimension = 10;  // up to here d is a constant

  struct Neighbour {
    double u[K];              // tangent coordinates
    double squared_distance;  // |q - p|^2
    double off_tangent2;      // dist(q, T_pM)^2
    std::uint32_t id;
  };

  // Lists p's neighbours once each, in p's tangent coordinates, and the neighbours of each simplex
  // of the star. d is a constant for usual dimensions.
  [[gnu::always_inline]] void Project(std::uint32_t p, int d) {
    star_ = stars_.Star(p);
    index_.Clear(star_.size());
    if (places_.size() < star_.size()) ReserveMore(star_.size(), d);
    std::uint32_t* column = columns_.data();
    const double* centre = PointOf(p, d);
    const double* tangent = mesh_.Tangent(p);
    double usual[kUsualDimension];
    if (d > kUsualDimension) normal_.resize(static_cast<std::size_t>(d));
    double* const normal = d > kUsualDimension ? normal_.data() : usual;
    for (std::size_t m = 0; m < star_.size(); ++m) {
      const std::uint32_t* ids = IdsOf(m);
      for (int i = 0; i <= K; ++i) {
        if (ids[i] == p) {
          places_[m] = static_cast<std::uint8_t>(i);
          continue;
        }
        const std::uint32_t known = index_.size();
        const std::uint32_t number = index_.Number(ids[i]);
        *column++ = number;
        if (index_.size() == known) continue;
        Neighbour& n = neighbours_[number];
        n.id = ids[i];
        const double* q = PointOf(ids[i], d);
        double* const offset = OffsetOf(number, d);
        for (int j = 0; j < d; ++j) offset[j] = normal[j] = q[j] - centre[j];
        for (int a = 0; a < K; ++a) n.u[a] = Dot(tangent + a * d, offset, d);
        n.squared_distance = Dot(offset, offset, d);
        for (int a = 0; a < K; ++a) {
          for (int j = 0; j < d; ++j) normal[j] -= tangent[a * d + j] * n.u[a];
        }
        n.off_tangent2 = Dot(normal, normal, d);
      }
    }
    part_.neighbours += index_.size();
  }

  // For stars of so many simplices.
  void ReserveMore(std::size_t simplices, int d) {
    places_.resize(simplices);
    signs_.resize(simplices);
    columns_.resize(simplices * K);
    neighbours_.resize(simplices * K);  // no more than that
    offsets_.resize(simplices * K * static_cast<std::size_t>(d));
  }

  // The star's m-th simplex.
  const std::uint32_t* IdsOf(std::size_t m) const { return ids_ + std::size_t{star_[m]} * (K + 1); }
  const double* PointOf(std::uint32_t v, int d) const {
    return mesh_.points + std::size_t{v} * static_cast<std::size_t>(d);
  }
  double* OffsetOf(std::uint32_t number, int d) {
    return offsets_.data() + std::size_t{number} * static_cast<std::size_t>(d);
  }

  // Measures the tilts of the star's simplices, and the shapes of those whose lowest vertex is p.
  [[gnu::always_inline]] void MeasureShapes(std::uint32_t p, int d) {
    const std::uint32_t* column = columns_.data();
    SimplexGram<K> gram;
    for (std::size_t m = 0; m < star_.size(); ++m, column += K) {
      const std::uint32_t s = star_[m];
      for (int c = 0; c < K; ++c) gram.dots[c][c] = neighbours_[column[c]].squared_distance;
      if (places_[m] == 0) {
        const auto [shortest2, longest2] = TakeEdges(IdsOf(m), d, &gram);
        const SimplexGram<K>* telling = gram.Factor() ? &gram : nullptr;
        sweep_.shape.Tilt<K>(s, p, telling, ColumnsOf(m), &shapes_);
        sweep_.shape.Measure<K>(s, telling, shortest2, longest2, &shapes_);
        continue;
      }
      for (int c = 1; c < K; ++c)
        for (int e = 0; e < c; ++e)
          gram.dots[c][e] = Dot(OffsetOf(column[c], d), OffsetOf(column[e], d), d);
      sweep_.shape.Tilt<K>(s, p, gram.Factor() ? &gram : nullptr, ColumnsOf(m), &shapes_);
    }
  }

  // Completes the Gram matrix of edges from a simplex's lowest vertex, whose diagonal is given, by
  // the lengths of the other edges. Returns the shortest and the longest edge, squared.
  [[gnu::always_inline]] std::pair<double, double> TakeEdges(const std::uint32_t* ids, int d,
                                                             SimplexGram<K>* gram) const {
    double shortest2 = std::numeric_limits<double>::infinity(), longest2 = 0;
    const auto take = [&](double edge2) {
      shortest2 = std::min(shortest2, edge2);
      longest2 = std::max(longest2, edge2);
    };
    for (int c = 0; c < K; ++c) {
      take(gram->dots[c][c]);
      for (int e = 0; e < c; ++e) {
        const double edge2 = SquaredDistance(PointOf(ids[c + 1], d), PointOf(ids[e + 1], d), d);
        take(edge2);
        gram->dots[c][e] = (gram->dots[c][c] + gram->dots[e][e] - edge2) / 2;
      }
    }
    return {shortest2, longest2};
  }

  void MeasureReach(std::uint32_t p) {
    const std::span<const Neighbour> neighbours(neighbours_.data(), index_.size());
    double longest2 = 0;
    for (const Neighbour& n : neighbours) longest2 = std::max(longest2, n.squared_distance);
    sweep_.longest_edge[p] = std::sqrt(longest2);
    for (const Neighbour& n : neighbours) {
      if (n.squared_distance < kTellingEdge * kTellingEdge * longest2) continue;
      const double reach =
          ReachBound(n.squared_distance, std::sqrt(n.off_tangent2 + Beyond2(p, n)));
      if (reach < result_.reach) {
        result_.reach = reach;
        result_.narrowest_p = p;
        result_.narrowest_q = n.id;
      }
    }
  }

  // Returns for a boundary vertex how far a neighbour is beyond the tangent cone, squared, at
  // least: the manifold bends back over its own boundary there.
  double Beyond2(std::uint32_t p, const Neighbour& n) const {
    if (CountWalls(mesh_.WallsOf(p)) != 1 || !mesh_.HasOutside(p)) return 0;
    const double beyond = Dot(mesh_.Outward(p), n.u, K);
    return beyond > 0 ? beyond * beyond : 0;
  }

  // Returns the tangent coordinates of the other vertices of the star's m-th simplex, by ascending
  // id.
  Columns<K> ColumnsOf(std::size_t m) const {
    Columns<K> u;
    for (int c = 0; c < K; ++c) u[c] = neighbours_[columns_[m * K + static_cast<std::size_t>(c)]].u;
    return u;
  }

  void Judge(std::uint32_t p) {
    const char* why = WhyNotEmbedded(p);
    if (!why) return;
    if (result_.unembedded_stars++ == 0)
      result_.first_unembedded = Message("the star of vertex ", p, " ", why);
    if (result_.unembedded_stars <= Violations::kMost) result_.some_unembedded.push_back(p);
  }

  // Whether the star embeds and its link is a sphere. If so, notes how it orients its simplices.
  bool Embeds(std::uint32_t p) {
    if constexpr (K <= kMostLocal) {
      if (WhyNotEmbedded(p)) return false;
      if (!link_.IsSphereUnfolded({columns_.data(), star_.size() * K}, index_.size(), signs_))
        return false;
      for (std::size_t m = 0; m < star_.size(); ++m) {
        if ((places_[m] % 2 == 0) == (signs_[m] > 0)) continue;
        std::atomic_ref(sweep_.sides[star_[m]])
            .fetch_or(static_cast<std::uint8_t>(1u << places_[m]), std::memory_order_relaxed);
      }
      return true;
    } else {
      return false;
    }
  }

  const char* WhyNotEmbedded(std::uint32_t p) {
    // A ray well inside the first simplex, with weights that no symmetry shares.
    Random random(0x5757, p);
    std::array<double, K> ray{};
    for (const double* column : ColumnsOf(0)) {
      const double weight = 0.3 + 0.4 * random.Uniform();
      for (int r = 0; r < K; ++r) ray[r] += weight * column[r];
    }

    int hits = 0;
    for (std::size_t m = 0; m < star_.size(); ++m) {
      std::array<double, K> b;
      signs_[m] = Solve<K>(ColumnsOf(m), ray, b);
      if (signs_[m] == 0)
        return "holds a simplex that is degenerate as seen from its tangent space";
      double smallest = b[0], largest = std::abs(b[0]);
      for (int r = 1; r < K; ++r) {
        smallest = std::min(smallest, b[r]);
        largest = std::max(largest, std::abs(b[r]));
      }
      hits += smallest > -kRayTolerance * largest;
    }
    if (const char* why = WhyFolded(p)) return why;
    if (hits != 1) return "covers some directions of its tangent space more than once";
    return mesh_.HasOutside(p) && HasSimplexOutward(p)
               ? "covers directions that lie beyond the boundary"
               : nullptr;
  }

  // Whether a simplex in the star of a boundary vertex meets the outward ray.
  bool HasSimplexOutward(std::uint32_t p) const {
    std::array<double, K> ray;
    std::copy_n(mesh_.Outward(p), K, ray.begin());
    for (std::size_t m = 0; m < star_.size(); ++m) {
      std::array<double, K> b;
      if (Solve<K>(ColumnsOf(m), ray, b) == 0) return true;
      if (*std::min_element(b.begin(), b.end()) > 0) return true;
    }
    return false;
  }

  // The projected simplices of the star must all have the orientation of the mesh, or all the
  // opposite: p's place decides the sign with p moved to the front.
  bool IsOriented(std::uint32_t p) const {
    const auto star = star_;
    int all = 0;
    for (std::size_t m = 0; m < star.size(); ++m) {
      const std::uint32_t* ids = stars_.list()[star[m]];
      int side = signs_[m] * sweep_.orientation[star[m]];
      for (int i = 0; ids[i] != p; ++i) side = -side;
      if (side == -all) return false;
      all = side;
    }
    return true;
  }

  const char* WhyFolded(std::uint32_t p) const {
    if (!sweep_.adjacency) return nullptr;  // LocalLink decides
    if (sweep_.orientation.empty()) return WhyFoldedAtFacets(p);
    return IsOriented(p) ? nullptr : kFolded;
  }

  // Decides without an orientation, facet by facet.
  const char* WhyFoldedAtFacets(std::uint32_t p) const {
    const Adjacency& adjacency = *sweep_.adjacency;
    const auto star = star_;
    for (std::size_t m = 0; m < star.size(); ++m) {
      const std::uint32_t s = star[m];
      const std::uint32_t* ids = stars_.list()[s];
      int column = -1;
      for (int i = 0; i <= K; ++i) {
        if (ids[i] == p) continue;
        ++column;
        const std::uint32_t t = adjacency.Across(s, i);
        if (t == Adjacency::kNone) {
          if (mesh_.WallsOf(p) != 0) continue;
          return "has a boundary";
        }
        if (t < s) continue;
        // With the apex moved behind the facet, the two determinants must differ in sign.
        const int apex = adjacency.Apex(s, t);
        const int apex_column = apex - (p < stars_.list()[t][apex]);
        const int flips = (K - 1 - column) + (K - 1 - apex_column);
        const auto other = std::lower_bound(star.begin(), star.end(), t) - star.begin();
        const int side =
            signs_[m] * signs_[static_cast<std::size_t>(other)] * (flips % 2 == 0 ? 1 : -1);
        if (side > 0) return kFolded;
      }
    }
    return nullptr;
  }

  Sweep& sweep_;
  const MeshView& mesh_;
  const VertexStars& stars_;
  const std::uint32_t* const ids_;  // of all simplices
  PartOfStars& part_;
  StarGeometry& result_;
  ShapeSearch::Worker shapes_;
  std::span<const std::uint32_t> star_;  // of the centre at hand
  SmallIndex index_;                     // of the neighbours
  std::vector<Neighbour> neighbours_;    // by number in the index; then some of stars before
  std::vector<std::uint32_t>
      columns_;                       // by simplex of the star, K each: places among the neighbours
  std::vector<double> offsets_;       // of the neighbours, d each
  std::vector<double> normal_;        // d, where that is large
  std::vector<std::uint8_t> places_;  // by simplex of the star: the centre's among its vertices
  std::vector<int> signs_;            // and that of its determinant
  LocalLink<std::min(K, kMostLocal)> link_;  // where there is no adjacency
};

}  // namespace stellate::core
