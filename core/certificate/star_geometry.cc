#include "core/certificate/star_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/certificate/first_ids.h"
#include "core/certificate/small_index.h"
#include "core/certificate/small_solve.h"
#include "core/geometry/reach_bound.h"
#include "core/report.h"

namespace stellate::core {
namespace {

// Shorter edges than this share of the longest at a vertex say little of curvature and much of
// the oracle's noise.
constexpr double kTellingEdge = 0.5;
// A solution this little below zero, beside its largest entry, still counts as a hit of the ray.
constexpr double kRayTolerance = 1e-12;
constexpr const char* kFolded = "folds over itself in its tangent space";

template <int K>
using Columns = std::array<const double*, K>;  // of a K x K matrix

// The sign of the columns' determinant, and |determinant| times the solution of columns . b = ray;
// 0 when the determinant is within rounding of zero, as SmallSystem says.
template <int K>
int Solve(const Columns<K>& u, const std::array<double, K>& ray, std::array<double, K>& b) {
  SmallSystem system;
  for (int r = 0; r < K; ++r) {
    for (int c = 0; c < K; ++c) system.a[r][c] = u[c][r];
    system.b[r] = ray[r];
  }
  const int sign = system.Solve(std::integral_constant<int, K>{});
  std::copy_n(system.b.begin(), K, b.begin());
  return sign;
}

// By Cramer's rule.
template <>
int Solve<2>(const Columns<2>& u, const std::array<double, 2>& ray, std::array<double, 2>& b) {
  const double determinant = u[0][0] * u[1][1] - u[0][1] * u[1][0];
  const double lengths2 =
      (u[0][0] * u[0][0] + u[0][1] * u[0][1]) * (u[1][0] * u[1][0] + u[1][1] * u[1][1]);
  if (!IsTellingDeterminant(determinant, lengths2)) return 0;
  const int sign = determinant > 0 ? 1 : -1;
  b[0] = sign * (ray[0] * u[1][1] - ray[1] * u[1][0]);
  b[1] = sign * (u[0][0] * ray[1] - u[0][1] * ray[0]);
  return sign;
}

inline std::array<double, 3> Cross(const double* a, const double* b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <>
int Solve<3>(const Columns<3>& u, const std::array<double, 3>& ray, std::array<double, 3>& b) {
  const std::array<std::array<double, 3>, 3> normals{Cross(u[1], u[2]), Cross(u[2], u[0]),
                                                     Cross(u[0], u[1])};
  const double determinant = Dot(u[0], normals[0].data(), 3);
  double lengths2 = 1;
  for (const double* column : u) lengths2 *= Dot(column, column, 3);
  if (!IsTellingDeterminant(determinant, lengths2)) return 0;
  const int sign = determinant > 0 ? 1 : -1;
  for (int c = 0; c < 3; ++c) b[c] = sign * Dot(ray.data(), normals[c].data(), 3);
  return sign;
}

// The stars of some of the vertices.
template <int K>
class StarMeasurer {
 public:
  StarMeasurer(const MeshView& mesh, const Adjacency& adjacency,
               std::span<const std::int8_t> orientation, double* longest_edge)
      : mesh_(mesh),
        adjacency_(adjacency),
        orientation_(adjacency.bad_facets() == 0 ? orientation : std::span<const std::int8_t>()),
        longest_edge_(longest_edge) {
    result_.reach = std::numeric_limits<double>::infinity();
  }

  StarGeometry Run(std::size_t begin, std::size_t end) {
    WithDimension(mesh_.d, [&](auto known) {
      const int d = known() > 0 ? known() : mesh_.d;
      for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) {
        if (adjacency_.Star(p).empty()) continue;
        Project(p, d);
        MeasureReach(p);
        if (const char* why = WhyNotEmbedded(p)) {
          if (result_.unembedded_stars++ == 0)
            result_.first_unembedded = Message("the star of vertex ", p, " ", why);
          if (result_.unembedded_stars <= Violations::kMost) result_.some_unembedded.push_back(p);
        }
      }
    });
    return std::move(result_);
  }

 private:
  static constexpr int kUsualDimension = 10;  // up to here d is a constant

  struct Neighbour {
    double u[K];              // tangent coordinates
    double squared_distance;  // |q - p|^2
    double off_tangent2;      // dist(q, T_pM)^2
    std::uint32_t id;
  };

  // p's neighbours as p sees them, each once; by simplex of the star, which they are. d is a
  // constant where it is usual.
  [[gnu::always_inline]] void Project(std::uint32_t p, int d) {
    const auto star = adjacency_.Star(p);
    index_.Clear(star.size());
    columns_.resize(star.size() * K);
    neighbours_.resize(std::max(neighbours_.size(), columns_.size()));  // no more than that
    std::uint32_t* column = columns_.data();
    const double* centre = mesh_.Point(p);
    const double* tangent = mesh_.Tangent(p);
    double usual[kUsualDimension];
    if (d > kUsualDimension) offset_.resize(static_cast<std::size_t>(d));
    double* const offset = d > kUsualDimension ? offset_.data() : usual;
    for (const std::uint32_t s : star) {
      const std::uint32_t* ids = adjacency_.list()[s];
      for (int i = 0; i <= K; ++i) {
        if (ids[i] == p) continue;
        const std::uint32_t known = index_.size();
        const std::uint32_t number = index_.Number(ids[i]);
        *column++ = number;
        if (index_.size() == known) continue;
        Neighbour& n = neighbours_[number];
        n.id = ids[i];
        const double* q = mesh_.Point(ids[i]);
        for (int j = 0; j < d; ++j) offset[j] = q[j] - centre[j];
        for (int a = 0; a < K; ++a) n.u[a] = Dot(tangent + a * d, offset, d);
        n.squared_distance = Dot(offset, offset, d);
        for (int a = 0; a < K; ++a) {
          for (int j = 0; j < d; ++j) offset[j] -= tangent[a * d + j] * n.u[a];
        }
        n.off_tangent2 = Dot(offset, offset, d);
      }
    }
  }

  void MeasureReach(std::uint32_t p) {
    const std::span<const Neighbour> neighbours(neighbours_.data(), index_.size());
    double longest2 = 0;
    for (const Neighbour& n : neighbours) longest2 = std::max(longest2, n.squared_distance);
    longest_edge_[p] = std::sqrt(longest2);
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

  // Of a vertex of the boundary: how far a neighbour is beyond the tangent cone, squared, at least:
  // the manifold bends back over its own boundary there.
  double Beyond2(std::uint32_t p, const Neighbour& n) const {
    if (CountWalls(mesh_.WallsOf(p)) != 1) return 0;
    const double beyond = Dot(mesh_.Outward(p), n.u, K);
    return beyond > 0 ? beyond * beyond : 0;
  }

  // The tangent coordinates of the other vertices of the star's m-th simplex, in the order of their
  // ids.
  Columns<K> ColumnsOf(std::size_t m) const {
    Columns<K> u;
    for (int c = 0; c < K; ++c) u[c] = neighbours_[columns_[m * K + static_cast<std::size_t>(c)]].u;
    return u;
  }

  const char* WhyNotEmbedded(std::uint32_t p) {
    const auto star = adjacency_.Star(p);
    // A ray well inside the first simplex, with weights that no symmetry shares.
    Random random(0x5757, p);
    std::array<double, K> ray{};
    for (const double* column : ColumnsOf(0)) {
      const double weight = 0.3 + 0.4 * random.Uniform();
      for (int r = 0; r < K; ++r) ray[r] += weight * column[r];
    }

    signs_.resize(star.size());
    int hits = 0;
    for (std::size_t m = 0; m < star.size(); ++m) {
      std::array<double, K> b;
      signs_[m] = Solve<K>(ColumnsOf(m), ray, b);
      if (signs_[m] == 0) return "holds a simplex that is degenerate from its tangent space";
      double smallest = b[0], largest = std::abs(b[0]);
      for (int r = 1; r < K; ++r) {
        smallest = std::min(smallest, b[r]);
        largest = std::max(largest, std::abs(b[r]));
      }
      hits += smallest > -kRayTolerance * largest;
    }
    if (orientation_.empty()) {
      if (const char* why = WhyFolded(p)) return why;
    } else if (!IsOriented(p)) {
      return kFolded;
    }
    if (hits != 1) return "covers some directions of its tangent space more than once";
    return mesh_.WallsOf(p) != 0 && HasSimplexOutward(p)
               ? "covers directions that lie beyond the boundary"
               : nullptr;
  }

  // Of a vertex of the boundary: whether a simplex of its star meets the ray outward.
  bool HasSimplexOutward(std::uint32_t p) const {
    std::array<double, K> ray;
    std::copy_n(mesh_.Outward(p), K, ray.begin());
    for (std::size_t m = 0; m < adjacency_.Star(p).size(); ++m) {
      std::array<double, K> b;
      if (Solve<K>(ColumnsOf(m), ray, b) == 0) return true;
      if (*std::min_element(b.begin(), b.end()) > 0) return true;
    }
    return false;
  }

  // Projected, all simplices of the star must be oriented alike, or all against the orientation of
  // the mesh: p's place decides the sign with p moved to the front.
  bool IsOriented(std::uint32_t p) const {
    const auto star = adjacency_.Star(p);
    int all = 0;
    for (std::size_t m = 0; m < star.size(); ++m) {
      const std::uint32_t* ids = adjacency_.list()[star[m]];
      int side = signs_[m] * orientation_[star[m]];
      for (int i = 0; ids[i] != p; ++i) side = -side;
      if (side == -all) return false;
      all = side;
    }
    return true;
  }

  // Without an orientation, facet by facet.
  const char* WhyFolded(std::uint32_t p) const {
    const auto star = adjacency_.Star(p);
    for (std::size_t m = 0; m < star.size(); ++m) {
      const std::uint32_t s = star[m];
      const std::uint32_t* ids = adjacency_.list()[s];
      int column = -1;
      for (int i = 0; i <= K; ++i) {
        if (ids[i] == p) continue;
        ++column;
        const std::uint32_t t = adjacency_.Across(s, i);
        if (t == Adjacency::kNone) {
          if (mesh_.WallsOf(p) != 0) continue;
          return "has a boundary";
        }
        if (t < s) continue;
        // With the apex moved behind the facet, the two determinants must differ in sign.
        const int apex = adjacency_.Apex(s, t);
        const int apex_column = apex - (p < adjacency_.list()[t][apex]);
        const int flips = (K - 1 - column) + (K - 1 - apex_column);
        const auto other = std::lower_bound(star.begin(), star.end(), t) - star.begin();
        const int side =
            signs_[m] * signs_[static_cast<std::size_t>(other)] * (flips % 2 == 0 ? 1 : -1);
        if (side > 0) return kFolded;
      }
    }
    return nullptr;
  }

  const MeshView& mesh_;
  const Adjacency& adjacency_;
  const std::span<const std::int8_t> orientation_;  // empty when it does not help
  double* const longest_edge_;                      // by vertex
  StarGeometry result_;
  SmallIndex index_;                   // of the neighbours
  std::vector<Neighbour> neighbours_;  // by number in the index; then some of stars before
  std::vector<std::uint32_t>
      columns_;                 // by simplex of the star, K each: places among the neighbours
  std::vector<double> offset_;  // d, where that is large
  std::vector<int> signs_;      // by simplex of the star
};

template <int K>
StarGeometry Measure(const MeshView& mesh, const Adjacency& adjacency,
                     std::span<const std::int8_t> orientation) {
  StarGeometry whole;
  whole.reach = std::numeric_limits<double>::infinity();
  whole.longest_edge.assign(mesh.vertices, 0);
  std::vector<StarGeometry> parts(ChunkCount(mesh.vertices));
  ParallelChunks(mesh.vertices, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    parts[chunk] =
        StarMeasurer<K>(mesh, adjacency, orientation, whole.longest_edge.data()).Run(begin, end);
  });
  for (StarGeometry& part : parts) {
    if (part.reach < whole.reach) {
      whole.reach = part.reach;
      whole.narrowest_p = part.narrowest_p;
      whole.narrowest_q = part.narrowest_q;
    }
    if (whole.unembedded_stars == 0) whole.first_unembedded = std::move(part.first_unembedded);
    whole.unembedded_stars += part.unembedded_stars;
    AppendFirst(part.some_unembedded, Violations::kMost, &whole.some_unembedded);
  }
  return whole;
}

}  // namespace

StarGeometry MeasureStars(const MeshView& mesh, const Adjacency& adjacency,
                          std::span<const std::int8_t> orientation) {
  return WithMeshDimension(mesh.k,
                           [&](auto k) { return Measure<k()>(mesh, adjacency, orientation); });
}

}  // namespace stellate::core
