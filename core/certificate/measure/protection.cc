#include "core/certificate/measure/protection.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/vector_ops.h"
#include "core/geometry/common_centre.h"
#include "core/index/ball_tree.h"

namespace stellate::core {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
// Gaps are decided with this margin, a share of the circumradius: far more than rounding.
constexpr double kMargin = 1e-9;
// The theorem of complexes: bounds that its proof assumes, and that are then checked. Of distances
// from a vertex, as shares of the largest known; of the circumradius, as a share of the reach.
constexpr double kFarther = 1.05, kFartherStill = 1.25, kFlatEnough = 0.225;
constexpr int kHalvings = 50;

// A simplex seen from one of its vertices p: the point equidistant from its vertices that lies in
// T_p, or their common centre.
template <int K>
struct Seen {
  double radius = 0;
  double gap = -kInfinite;        // to the nearest other vertex; -infinity: there is no centre
  std::array<double, K> edges{};  // lengths at p
  // Of the matrix A whose rows are the edges at p, in coordinates of T_p or of space: (A A^t)^-1.
  Eigen::Matrix<double, K, K> inverse;
  double turns = 1;  // 0: the centre does not depend on tangent spaces

  // Returns the longest of the shortest solutions x of A x = b with |b_s| <= most_s.
  double Farthest(const std::array<double, K>& most) const {
    double farthest2 = 0;
    for (unsigned signs = 0; signs < 1u << (K - 1); ++signs) {
      Eigen::Matrix<double, K, 1> b;
      for (int s = 0; s < K; ++s)
        b[s] = (signs >> s & 1u) != 0 ? -most[static_cast<std::size_t>(s)]
                                      : most[static_cast<std::size_t>(s)];
      farthest2 = std::max(farthest2, b.dot(inverse * b));
    }
    return std::sqrt(farthest2);
  }
};

// Whether the other vertices stay outside of the ball if all vertices move by `rho` and tangent
// spaces turn as on a manifold of that reach (docs/using/protection.md, Stability).
template <int K>
bool StaysEmpty(const Seen<K>& seen, double rho, double reach) {
  const double turn = seen.turns * rho / reach;
  const double sum = 2 * seen.radius + seen.gap;
  std::array<double, K> most;
  double loss = 0;  // of the smallest singular value, at most this share
  for (std::size_t s = 0; s < K; ++s) {
    const double edge = 2 * rho + turn * seen.edges[s];
    most[s] = 2 * rho * seen.edges[s] + 2 * rho * rho + edge * seen.radius;
    const auto i = static_cast<Eigen::Index>(s);
    loss += edge * std::sqrt(seen.inverse(i, i));
  }
  if (!(loss < 1)) return false;
  const double moved = seen.Farthest(most) / (1 - loss);
  return seen.gap / 2 - kMargin * seen.radius >
         2 * rho + 2 * rho * seen.radius / sum + turn * seen.radius + (1 + 2 * rho / sum) * moved;
}

// Returns the largest rho up to `most` for which the ball stays empty.
template <int K>
double StableRadius(const Seen<K>& seen, double most, double reach) {
  if (!(seen.gap > 0)) return 0;
  double low = 0, high = std::min(most, seen.gap / 4);
  if (StaysEmpty<K>(seen, high, reach)) return high;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    (StaysEmpty<K>(seen, middle, reach) ? low : high) = middle;
  }
  return low;
}

// The theorem of complexes, for some facts.
struct Complexes {
  double reach, far, farther, excess;

  explicit Complexes(const ProtectionFacts& facts, double largest_radius)
      : reach(facts.reach),
        far(kFarther * std::max(Along(facts.cover), largest_radius)),
        farther(kFartherStill * far),
        excess(farther * farther * Longer(farther) * (2 + Longer(farther))) {}

  // A bound of arcsin(t) / t - 1 at t = chord / 2r <= 1/2: a geodesic is longer than its chord by
  // no more than that share.
  double Longer(double chord) const {
    const double t2 = chord * chord / (4 * reach * reach);
    return t2 / 6 + t2 * t2 / 8;
  }
  double Along(double chord) const { return chord * (1 + Longer(chord)); }

  // Returns the gap that the simplex needs.
  template <int K>
  double NeededGap(const Seen<K>& seen) const {
    if (!(farther <= reach) || !std::isfinite(seen.gap)) return kInfinite;
    const double bend = far * far / (2 * reach * reach);
    std::array<double, K> half;
    for (std::size_t s = 0; s < K; ++s)
      half[s] = (bend * seen.edges[s] * seen.edges[s] + excess) / 2;
    const double moved = seen.Farthest(half), out = seen.radius + moved;
    if (!(out <= kFlatEnough * reach)) return kInfinite;
    const double chord2 = 2 * out * out / (1 + std::sqrt(1 - out * out / (reach * reach)));
    if (!(chord2 <= far * far) || !(out + far * far / (2 * reach) <= farther)) return kInfinite;
    const double sum = 2 * seen.radius + std::max(seen.gap, 0.0);
    return bend * sum + 2 * moved + excess / sum + kMargin * seen.radius;
  }
};

template <int K>
class Meter {
 public:
  Meter(const MeshView& mesh, const ProtectionFacts& facts)
      : mesh_(mesh),
        facts_(facts),
        d_(mesh.d),
        points_(mesh.points, mesh.points + mesh.vertices * static_cast<std::uint64_t>(mesh.d)),
        tree_(mesh.d, &points_),
        count_(mesh.simplices->size() / (K + 1)) {
    tree_.Assign(std::vector<double>(mesh.vertices, 0), BallTree::Halving::kExtent);
  }

  ProtectionFindings Measure() {
    std::vector<Part> parts(ChunkCount(count_));
    std::vector<Place> places(count_);
    ParallelChunks(count_, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s) Judge(s, &places[s], &parts[chunk]);
    });
    Part all;
    for (const Part& part : parts) {
      all.stable = std::min(all.stable, part.stable);
      all.smallest = std::min(all.smallest, part.smallest);
      all.largest = std::max(all.largest, part.largest);
    }
    ProtectionFindings measured;
    Summarize(places, all, &measured.report);
    if (std::isfinite(facts_.reach)) CompareComplexes(all.largest, &measured);
    return measured;
  }

 private:
  struct Place {
    double gap, radius;  // of the worst centre
  };
  struct Part {
    double stable = kInfinite, smallest = kInfinite, largest = 0;
  };

  const std::uint32_t* Ids(std::size_t s) const { return mesh_.simplices->data() + s * (K + 1); }

  // Completes what was seen: the nearest vertex that is not the simplex's.
  void FindGap(const std::uint32_t* ids, const double* centre, Seen<K>* seen) const {
    std::array<std::pair<double, std::uint32_t>, K + 2> nearest;
    const int found = FindNearest(tree_, centre, K + 2, nearest.data());
    seen->gap = kInfinite;
    for (int i = found - 1; i >= 0; --i) {
      const auto& [distance2, q] = nearest[static_cast<std::size_t>(i)];
      if (std::find(ids, ids + K + 1, q) == ids + K + 1)
        seen->gap = std::sqrt(distance2) - seen->radius;
    }
  }

  Seen<K> FromTangentSpace(const std::uint32_t* ids, int at) const {
    Seen<K> seen;
    const std::uint32_t p = ids[at];
    Eigen::Matrix<double, K, K> a;
    Eigen::Matrix<double, K, 1> b;
    for (int i = 0, s = 0; i <= K; ++i) {
      if (i == at) continue;
      const double length2 = SquaredDistance(mesh_.Point(ids[i]), mesh_.Point(p), d_);
      seen.edges[static_cast<std::size_t>(s)] = std::sqrt(length2);
      b[s] = length2 / 2;
      for (int r = 0; r < K; ++r) {
        const double* const t = mesh_.Tangent(p) + r * d_;
        a(s, r) = Dot(t, mesh_.Point(ids[i]), d_) - Dot(t, mesh_.Point(p), d_);
      }
      ++s;
    }
    const Eigen::Matrix<double, K, K> solved = Inverse<K>(a);
    const Eigen::Matrix<double, K, 1> x = solved * b;
    if (!x.allFinite()) return seen;
    seen.inverse = solved.transpose() * solved;
    seen.radius = x.norm();
    std::vector<double> centre(mesh_.Point(p), mesh_.Point(p) + d_);
    for (int r = 0; r < K; ++r)
      for (int j = 0; j < d_; ++j)
        centre[static_cast<std::size_t>(j)] += x[r] * mesh_.Tangent(p)[r * d_ + j];
    FindGap(ids, centre.data(), &seen);
    return seen;
  }

  // Returns false if the simplex has no common centre.
  bool FromCommonCentre(const std::uint32_t* ids, Seen<K>* seen) const {
    std::array<const double*, K + 1> points, tangents;
    for (std::size_t i = 0; i <= K; ++i) {
      points[i] = mesh_.Point(ids[i]);
      tangents[i] = mesh_.Tangent(ids[i]);
    }
    const std::array<double, K + 1> weights{};
    std::vector<double> centre(static_cast<std::size_t>(d_));
    if (!CommonCentre<K>(d_, points.data(), tangents.data(), weights.data(), kInfinite,
                         centre.data()))
      return false;
    seen->turns = 0;
    seen->radius = std::sqrt(Dot(centre.data(), centre.data(), d_));
    for (int j = 0; j < d_; ++j) centre[static_cast<std::size_t>(j)] += points[0][j];
    Eigen::Matrix<double, K, K> gram;
    for (std::size_t s = 1; s <= K; ++s) seen->edges[s - 1] = Distance(points[s], points[0], d_);
    for (std::size_t s = 1; s <= K; ++s)
      for (std::size_t t = 1; t <= K; ++t)
        gram(static_cast<Eigen::Index>(s) - 1, static_cast<Eigen::Index>(t) - 1) =
            (seen->edges[s - 1] * seen->edges[s - 1] + seen->edges[t - 1] * seen->edges[t - 1] -
             SquaredDistance(points[s], points[t], d_)) /
            2;
    seen->inverse = Inverse<K>(gram);
    if (!seen->inverse.allFinite()) return false;
    FindGap(ids, centre.data(), seen);
    return true;
  }

  void Judge(std::size_t s, Place* place, Part* part) const {
    const std::uint32_t* const ids = Ids(s);
    *place = {kInfinite, 0};
    const auto take = [&](const Seen<K>& seen) {
      if (seen.gap < place->gap) *place = {seen.gap, seen.radius};
      part->smallest = std::min(part->smallest, seen.radius);
      part->largest = std::max(part->largest, seen.radius);
      part->stable = StableRadius<K>(seen, part->stable, facts_.reach);
    };
    if (Seen<K> seen;
        facts_.centre_rule == CentreRule::kCommonCentre && FromCommonCentre(ids, &seen))
      return take(seen);
    for (int i = 0; i <= K; ++i) take(FromTangentSpace(ids, i));
  }

  void Summarize(const std::vector<Place>& places, const Part& all,
                 ProtectionReport* report) const {
    report->asked = facts_.asked;
    std::vector<double> gaps;
    gaps.reserve(count_);
    report->least_ratio = kInfinite;
    std::size_t worst = 0;
    for (std::size_t s = 0; s < count_; ++s) {
      const auto& [gap, radius] = places[s];
      gaps.push_back(gap);
      report->weak += gap < facts_.asked * (1 - kMargin) - kMargin * radius;
      report->least_ratio = std::min(report->least_ratio, gap / radius);
      if (gap < places[worst].gap) worst = s;
    }
    report->worst.assign(Ids(worst), Ids(worst) + K + 1);
    std::sort(gaps.begin(), gaps.end());
    report->least = gaps.front();
    report->percentile = gaps[gaps.size() / 100];
    report->median = gaps[gaps.size() / 2];
    report->stability_radius = all.stable;
    const double gap = report->least;
    if (gap > 0)
      report->thickness_bound = gap * (2 * all.smallest + gap) /
                                (2 * (all.largest + all.smallest)) / (K * 2 * all.largest);
  }

  void CompareComplexes(double largest, ProtectionFindings* measured) const {
    const Complexes complexes(facts_, largest);
    std::vector<std::optional<WorstPlace>> parts(ChunkCount(count_));
    const auto is_worse = [](const WorstPlace& a, const std::optional<WorstPlace>& b) {
      return !b || a.needed - a.gap > b->needed - b->gap;
    };
    ParallelChunks(count_, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      for (std::size_t s = begin; s < end; ++s)
        for (int i = 0; i <= K; ++i) {
          const Seen<K> seen = FromTangentSpace(Ids(s), i);
          const WorstPlace lack{static_cast<std::uint32_t>(s), seen.gap,
                                complexes.NeededGap<K>(seen)};
          if (!(lack.gap > lack.needed) && is_worse(lack, parts[chunk])) parts[chunk] = lack;
        }
    });
    for (const std::optional<WorstPlace>& part : parts)
      if (part && is_worse(*part, measured->worst)) measured->worst = part;
    measured->report.is_delaunay = !measured->worst;
  }

  const MeshView& mesh_;
  const ProtectionFacts facts_;
  const int d_;
  const std::vector<double> points_;
  BallTree tree_;
  const std::size_t count_;
};

}  // namespace

ProtectionFindings MeasureProtection(const MeshView& mesh, const ProtectionFacts& facts) {
  return mesh.k == 1   ? Meter<1>(mesh, facts).Measure()
         : mesh.k == 2 ? Meter<2>(mesh, facts).Measure()
                       : Meter<3>(mesh, facts).Measure();
}

}  // namespace stellate::core
