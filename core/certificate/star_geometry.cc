#include "core/certificate/star_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/certificate/small_solve.h"
#include "core/message.h"
#include "core/parallel.h"
#include "core/sample/random.h"
#include "core/sample/vector_ops.h"

namespace stellate::core {
namespace {

// Shorter edges than this share of the longest at a vertex say little of curvature and much of
// the oracle's noise.
constexpr double kTellingEdge = 0.5;
// A solution this little below zero, beside its largest entry, still counts as a hit of the ray.
constexpr double kRayTolerance = 1e-12;

// The stars of some of the vertices.
template <int K>
class StarMeasurer {
 public:
  StarMeasurer(const MeshView& mesh, const Adjacency& adjacency, double* longest_edge)
      : mesh_(mesh), adjacency_(adjacency), d_(mesh.d), longest_edge_(longest_edge) {
    result_.reach = std::numeric_limits<double>::infinity();
  }

  StarGeometry Run(std::size_t begin, std::size_t end) {
    for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p) {
      if (adjacency_.Star(p).empty()) continue;
      Project(p);
      MeasureReach(p);
      if (const char* why = WhyNotEmbedded(p)) {
        if (result_.unembedded_stars++ == 0) {
          result_.first_unembedded = Message("the star of vertex ", p, " ", why);
        }
      }
    }
    return std::move(result_);
  }

 private:
  struct Neighbour {
    double u[K];              // tangent coordinates
    double squared_distance;  // |q - p|^2
    double off_tangent2;      // dist(q, T_pM)^2
  };

  // p's neighbours as p sees them, each once; by simplex of the star, which they are.
  void Project(std::uint32_t p) {
    ids_.clear();
    neighbours_.clear();
    columns_.clear();
    const double* centre = mesh_.Point(p);
    const double* tangent = mesh_.Tangent(p);
    offset_.resize(d_);
    for (const std::uint32_t s : adjacency_.Star(p)) {
      const std::uint32_t* ids = adjacency_.list()[s];
      for (int i = 0; i <= K; ++i) {
        if (ids[i] == p) continue;
        const auto known = std::find(ids_.begin(), ids_.end(), ids[i]);
        columns_.push_back(static_cast<std::uint32_t>(known - ids_.begin()));
        if (known != ids_.end()) continue;
        ids_.push_back(ids[i]);
        Neighbour n{};
        const double* q = mesh_.Point(ids[i]);
        for (int j = 0; j < d_; ++j) offset_[j] = q[j] - centre[j];
        for (int a = 0; a < K; ++a) n.u[a] = Dot(tangent + a * d_, offset_.data(), d_);
        n.squared_distance = Dot(offset_.data(), offset_.data(), d_);
        for (int a = 0; a < K; ++a) {
          for (int j = 0; j < d_; ++j) offset_[j] -= tangent[a * d_ + j] * n.u[a];
        }
        n.off_tangent2 = Dot(offset_.data(), offset_.data(), d_);
        neighbours_.push_back(n);
      }
    }
  }

  void MeasureReach(std::uint32_t p) {
    double longest2 = 0;
    for (const Neighbour& n : neighbours_) longest2 = std::max(longest2, n.squared_distance);
    longest_edge_[p] = std::sqrt(longest2);
    for (std::size_t i = 0; i < neighbours_.size(); ++i) {
      const Neighbour& n = neighbours_[i];
      if (n.squared_distance < kTellingEdge * kTellingEdge * longest2) continue;
      const double reach = n.squared_distance / (2 * std::sqrt(n.off_tangent2));
      if (reach < result_.reach) {
        result_.reach = reach;
        result_.narrowest_p = p;
        result_.narrowest_q = ids_[i];
      }
    }
  }

  // Fills the columns of `system` with the tangent coordinates of the other vertices of the star's
  // m-th simplex, in the order of their ids.
  void Fill(std::size_t m, SmallSystem& system) const {
    for (int c = 0; c < K; ++c) {
      const double* u = neighbours_[columns_[m * K + static_cast<std::size_t>(c)]].u;
      for (int r = 0; r < K; ++r) system.a[r][c] = u[r];
    }
  }

  const char* WhyNotEmbedded(std::uint32_t p) {
    const auto star = adjacency_.Star(p);
    // A ray well inside the first simplex, with weights that no symmetry shares.
    Random random(0x5757, p);
    std::array<double, kMaxDimension> ray{};
    SmallSystem system;
    Fill(0, system);
    for (int c = 0; c < K; ++c) {
      const double weight = 0.3 + 0.4 * random.Uniform();
      for (int r = 0; r < K; ++r) ray[r] += weight * system.a[r][c];
    }

    signs_.resize(star.size());
    int hits = 0;
    for (std::size_t m = 0; m < star.size(); ++m) {
      Fill(m, system);
      system.b = ray;
      signs_[m] = system.Solve(std::integral_constant<int, K>{});
      if (signs_[m] == 0) return "holds a simplex that is degenerate from its tangent space";
      double largest = 0;
      for (int r = 0; r < K; ++r) largest = std::max(largest, std::abs(system.b[r]));
      const double floor = -kRayTolerance * largest;
      hits += std::all_of(system.b.begin(), system.b.begin() + K,
                          [floor](double x) { return x > floor; });
    }
    if (const char* why = WhyFolded(p)) return why;
    return hits == 1 ? nullptr : "covers some directions of its tangent space more than once";
  }

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
        if (t == Adjacency::kNone) return "has a boundary";
        if (t < s) continue;
        // With the apex moved behind the facet, the two determinants must differ in sign.
        const int flips = (K - 1 - column) + (K - 1 - ApexColumn(p, s, t));
        const auto other = std::lower_bound(star.begin(), star.end(), t) - star.begin();
        const int side =
            signs_[m] * signs_[static_cast<std::size_t>(other)] * (flips % 2 == 0 ? 1 : -1);
        if (side > 0) return "folds over itself in its tangent space";
      }
    }
    return nullptr;
  }

  // The column of t's vertex that is not in s.
  int ApexColumn(std::uint32_t p, std::uint32_t s, std::uint32_t t) const {
    const std::uint32_t* in_s = adjacency_.list()[s];
    const std::uint32_t* in_t = adjacency_.list()[t];
    int column = -1;
    for (int i = 0; i <= K; ++i) {
      if (in_t[i] == p) continue;
      ++column;
      if (std::find(in_s, in_s + K + 1, in_t[i]) == in_s + K + 1) break;
    }
    return column;
  }

  const MeshView& mesh_;
  const Adjacency& adjacency_;
  const int d_;
  double* const longest_edge_;  // by vertex
  StarGeometry result_;
  std::vector<std::uint32_t> ids_;  // of the neighbours
  std::vector<Neighbour> neighbours_;
  std::vector<std::uint32_t>
      columns_;                 // by simplex of the star, K each: places among the neighbours
  std::vector<double> offset_;  // d
  std::vector<int> signs_;      // by simplex of the star
};

template <int K>
StarGeometry Measure(const MeshView& mesh, const Adjacency& adjacency) {
  StarGeometry whole;
  whole.reach = std::numeric_limits<double>::infinity();
  whole.longest_edge.assign(mesh.vertices, 0);
  std::vector<StarGeometry> parts(ChunkCount(mesh.vertices));
  ParallelChunks(mesh.vertices, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    parts[chunk] = StarMeasurer<K>(mesh, adjacency, whole.longest_edge.data()).Run(begin, end);
  });
  for (StarGeometry& part : parts) {
    if (part.reach < whole.reach) {
      whole.reach = part.reach;
      whole.narrowest_p = part.narrowest_p;
      whole.narrowest_q = part.narrowest_q;
    }
    if (whole.unembedded_stars == 0) whole.first_unembedded = std::move(part.first_unembedded);
    whole.unembedded_stars += part.unembedded_stars;
  }
  return whole;
}

}  // namespace

StarGeometry MeasureStars(const MeshView& mesh, const Adjacency& adjacency) {
  switch (mesh.k) {
    case 1:
      return Measure<1>(mesh, adjacency);
    case 2:
      return Measure<2>(mesh, adjacency);
    case 3:
      return Measure<3>(mesh, adjacency);
    case 4:
      return Measure<4>(mesh, adjacency);
    default:
      return Measure<5>(mesh, adjacency);
  }
}

}  // namespace stellate::core
