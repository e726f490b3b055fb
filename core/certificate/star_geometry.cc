#include "core/certificate/star_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/certificate/small_solve.h"
#include "core/message.h"
#include "core/sample/random.h"
#include "core/sample/vector_ops.h"

namespace stellate::core {
namespace {

// Shorter edges than this share of the longest at a vertex say little of curvature and much of
// the oracle's noise.
constexpr double kTellingEdge = 0.5;
// A solution this little below zero, beside its largest entry, still counts as a hit of the ray.
constexpr double kRayTolerance = 1e-12;

class StarMeasurer {
 public:
  StarMeasurer(const MeshView& mesh, const Adjacency& adjacency)
      : mesh_(mesh),
        adjacency_(adjacency),
        k_(mesh.k),
        d_(mesh.d),
        number_(mesh.vertices, 0),
        index_of_(mesh.vertices, 0),
        place_(adjacency.list().size(), 0) {}

  StarGeometry Run() {
    result_.reach = std::numeric_limits<double>::infinity();
    result_.longest_edge.assign(mesh_.vertices, 0);
    for (std::uint32_t p = 0; p < mesh_.vertices; ++p) {
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
    std::uint32_t id;
    double squared_distance;  // |q - p|^2
    double off_tangent;       // dist(q, T_pM)
  };

  // Tangent coordinates of p's neighbours, numbered as they are met.
  void Project(std::uint32_t p) {
    neighbours_.clear();
    for (const std::uint32_t s : adjacency_.Star(p)) {
      const std::uint32_t* ids = adjacency_.list()[s];
      for (int i = 0; i <= k_; ++i) {
        if (ids[i] == p || number_[ids[i]] == p + 1) continue;
        number_[ids[i]] = p + 1;
        neighbours_.push_back({ids[i], 0, 0});
      }
    }
    flat_.assign(neighbours_.size() * k_, 0.0);
    const double* centre = mesh_.points + std::size_t{p} * d_;
    const double* tangent = mesh_.tangents + std::size_t{p} * d_ * k_;
    offset_.resize(d_);
    for (std::size_t n = 0; n < neighbours_.size(); ++n) {
      const double* q = mesh_.points + std::size_t{neighbours_[n].id} * d_;
      double* u = flat_.data() + n * k_;
      for (int i = 0; i < d_; ++i) {
        offset_[i] = q[i] - centre[i];
        for (int a = 0; a < k_; ++a) u[a] += tangent[i * k_ + a] * offset_[i];
      }
      neighbours_[n].squared_distance = Dot(offset_.data(), offset_.data(), d_);
      for (int i = 0; i < d_; ++i) {
        for (int a = 0; a < k_; ++a) offset_[i] -= tangent[i * k_ + a] * u[a];
      }
      neighbours_[n].off_tangent = std::sqrt(Dot(offset_.data(), offset_.data(), d_));
      index_of_[neighbours_[n].id] = static_cast<std::uint32_t>(n);
    }
  }

  void MeasureReach(std::uint32_t p) {
    double longest2 = 0;
    for (const Neighbour& n : neighbours_) longest2 = std::max(longest2, n.squared_distance);
    result_.longest_edge[p] = std::sqrt(longest2);
    for (const Neighbour& n : neighbours_) {
      if (n.squared_distance < kTellingEdge * kTellingEdge * longest2) continue;
      const double reach = n.squared_distance / (2 * n.off_tangent);
      if (reach < result_.reach) {
        result_.reach = reach;
        result_.narrowest_p = p;
        result_.narrowest_q = n.id;
      }
    }
  }

  // Fills the columns of `system` with the tangent coordinates of the simplex's other vertices,
  // in the order of their ids.
  void Fill(std::uint32_t p, std::uint32_t s, SmallSystem& system) const {
    const std::uint32_t* ids = adjacency_.list()[s];
    int column = 0;
    for (int i = 0; i <= k_; ++i) {
      if (ids[i] == p) continue;
      const double* u = flat_.data() + std::size_t{index_of_[ids[i]]} * k_;
      for (int r = 0; r < k_; ++r) system.a[r][column] = u[r];
      ++column;
    }
  }

  const char* WhyNotEmbedded(std::uint32_t p) {
    const auto star = adjacency_.Star(p);
    // A ray well inside the first simplex, with weights that no symmetry shares.
    Random random(0x5757, p);
    std::array<double, kMaxDimension> ray{};
    SmallSystem system;
    Fill(p, star.front(), system);
    for (int c = 0; c < k_; ++c) {
      const double weight = 0.3 + 0.4 * random.Uniform();
      for (int r = 0; r < k_; ++r) ray[r] += weight * system.a[r][c];
    }

    signs_.resize(star.size());
    int hits = 0;
    for (std::size_t m = 0; m < star.size(); ++m) {
      place_[star[m]] = static_cast<std::uint32_t>(m);
      Fill(p, star[m], system);
      system.b = ray;
      signs_[m] = system.Solve(k_);
      if (signs_[m] == 0) return "holds a simplex that is degenerate from its tangent space";
      double largest = 0;
      for (int r = 0; r < k_; ++r) largest = std::max(largest, std::abs(system.b[r]));
      const double floor = -kRayTolerance * largest;
      if (std::all_of(system.b.begin(), system.b.begin() + k_,
                      [floor](double x) { return x > floor; })) {
        ++hits;
      }
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
      for (int i = 0; i <= k_; ++i) {
        if (ids[i] == p) continue;
        ++column;
        const std::uint32_t t = adjacency_.Across(s, i);
        if (t == Adjacency::kNone) return "has a boundary";
        if (t < s) continue;
        // With the apex moved behind the facet, the two determinants must differ in sign.
        const int flips = (k_ - 1 - column) + (k_ - 1 - ApexColumn(p, s, t));
        const int side = signs_[m] * signs_[place_[t]] * (flips % 2 == 0 ? 1 : -1);
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
    for (int i = 0; i <= k_; ++i) {
      if (in_t[i] == p) continue;
      ++column;
      if (!std::binary_search(in_s, in_s + k_ + 1, in_t[i])) break;
    }
    return column;
  }

  const MeshView& mesh_;
  const Adjacency& adjacency_;
  const int k_, d_;
  StarGeometry result_;
  std::vector<Neighbour> neighbours_;
  std::vector<double> flat_;             // neighbours x k: tangent coordinates
  std::vector<double> offset_;           // d
  std::vector<std::uint32_t> number_;    // by vertex: last centre seen from, plus one
  std::vector<std::uint32_t> index_of_;  // by vertex: place among the neighbours
  std::vector<std::uint32_t> place_;     // by simplex: place in the star
  std::vector<int> signs_;               // by place in the star
};

}  // namespace

StarGeometry MeasureStars(const MeshView& mesh, const Adjacency& adjacency) {
  return StarMeasurer(mesh, adjacency).Run();
}

}  // namespace stellate::core
