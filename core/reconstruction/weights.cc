#include "core/reconstruction/weights.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

#include "core/base/dense.h"
#include "core/base/infinity.h"
#include "core/base/interruption.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/geometry/restricted_voronoi_cell.h"
#include "core/geometry/surroundings.h"
#include "core/index/indexed_points.h"

namespace stellate::core {
namespace {

// A weight is at most the squared distance to the nearest point, times the square of this.
constexpr double kOmega = 0.5;
// In spacings: of the simplex that a cell begins as.
constexpr double kCellInradius = 6;
constexpr std::size_t kMostNear = 2000;
// The limits of y are moved out by this share, so that no weight allowed is on the border.
constexpr double kBeyond = 0.01;
constexpr double kReachError = 1 + 1e-7;
// Intervals shorter than this share of all weights are no choice.
constexpr double kShort = 1e-9;
// cos^2 of 65 degrees: what tilts by more against the tangent space at a vertex is a sliver.
constexpr double kUpright2 = 0.1786;
// Sweeps over all points: most ever, and without fewer simplices to fix.
constexpr int kSweepsOfAll = 40;
constexpr int kVainSweeps = 6;
// Weights chosen for a point before the search gives up, on the average: one does for even points.
constexpr std::size_t kMostChoices = 4;

// The half-spaces of a cell, by number.
template <int D>
class HalfSpaceList final : public Surroundings<D> {
 public:
  void Reset(double inradius) {
    inradius_ = inradius;
    normals_.clear();
    offsets_.clear();
  }
  std::uint32_t Add(const std::array<double, D>& normal, double offset) {
    normals_.push_back(normal);
    offsets_.push_back(offset);
    return static_cast<std::uint32_t>(offsets_.size() - 1);
  }
  const std::array<double, D>& normal(std::uint32_t id) const { return normals_[id]; }

  double HalfSpace(std::uint32_t id, double* normal) const override {
    if (IsFake(id)) return FakeHalfSpace<D>(static_cast<int>(id - kFirstFakeId), inradius_, normal);
    std::copy(normals_[id].begin(), normals_[id].end(), normal);
    return offsets_[id];
  }
  int judged_in() const override { return 0; }
  bool Centre(const std::uint32_t*, std::uint64_t, double*, double*) const override {
    return false;
  }
  void Lift(const double*, double*) const override {}

 private:
  double inradius_ = 1;
  std::vector<std::array<double, D>> normals_;
  std::vector<double> offsets_;
};

template <int D>
struct CellMemory {
  HalfSpaceList<D> around;
  typename RestrictedVoronoiCell<D>::Scratch scratch;
  RestrictedVoronoiCell<D> cell;

  void Begin(double inradius) {
    around.Reset(inradius);
    cell.Reset(inradius, around);
  }
  void Cut(const std::array<double, D>& normal, double offset) {
    const std::uint32_t id = around.Add(normal, offset);
    cell.Clip(id, normal.data(), offset, scratch, around);
  }
};

// Searches weights. Ids are places in `ids`.
template <int K>
class WeightSearch {
 public:
  using Simplex = std::array<std::uint32_t, K + 1>;

  WeightSearch(const FittedCloud& cloud, const std::vector<std::uint32_t>& ids,
               const std::vector<double>& weights)
      : cloud_(cloud), ids_(ids), points_(cloud.d), near_(ids.size()), stars_(ids.size()) {
    for (const std::uint32_t p : ids) {
      points_.AddUnindexed(cloud.Position(p));
      weights_.push_back(weights[p]);
    }
    points_.Index();
    for (std::uint32_t p = 0; p < ids.size(); ++p) {
      MoreNear(p, kFirstNear);
      most_weight_ = std::max(most_weight_, MostWeight(p));
    }
  }

  // Returns the points that got another weight, ascending.
  std::set<std::uint32_t> Run(const std::vector<std::uint32_t>& centres, int sweeps) {
    std::set<std::uint32_t> at;
    for (const std::uint32_t p : centres) {
      at.insert(p);
      for (const Simplex& s : StarOf(p).simplices) at.insert(s.begin(), s.end());
    }
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      bool fine = true;
      for (const std::uint32_t p : at) {
        ThrowIfInterrupted();
        if (!IsConsistent(p)) fine = false;
      }
      if (fine) break;
      for (const std::uint32_t p : at) {
        ThrowIfInterrupted();
        Improve(p, sweep);
      }
    }
    return changed_;
  }

  // Weighs the points where stars disagree, and then those where they disagree or have slivers.
  // Returns whether all agree. done(share) is called now and then.
  bool RunOnAll(FunctionRef<void(double)> done) {
    for (const bool exudes : {false, true}) {
      exudes_ = exudes;
      std::size_t fewest = std::numeric_limits<std::size_t>::max(), choices = 0;
      int vain = 0;
      for (int sweep = 0; sweep < kSweepsOfAll; ++sweep) {
        std::set<std::uint32_t> at;
        const std::size_t bad = FindBad(&at);
        if (bad == 0 || vain == kVainSweeps) break;
        choices += at.size();
        if (choices > kMostChoices * ids_.size()) break;
        vain = bad < fewest ? 0 : vain + 1;
        fewest = std::min(fewest, bad);
        if (vain > 0)
          for (const std::uint32_t p : std::vector(at.begin(), at.end()))
            for (const Simplex& s : StarOf(p).simplices) at.insert(s.begin(), s.end());
        for (const std::uint32_t p : at) {
          ThrowIfInterrupted();
          Improve(p, sweep);
        }
        done((exudes ? 0.5 : 0) + 0.5 * sweep / kSweepsOfAll);
      }
      exudes_ = false;
      std::set<std::uint32_t> at;
      if (FindBad(&at) > 0) return false;
    }
    return true;
  }
  double weight(std::uint32_t p) const { return weights_[p]; }

 private:
  static constexpr std::size_t kFirstNear = K == 1 ? 8 : K == 2 ? 28 : 70;

  struct Star {
    bool built = false;
    std::vector<Simplex> simplices;
    std::vector<std::uint64_t> keys;
    double most2 = 0;  // its largest circumradius, squared
  };
  // A simplex that a star has while y is between two values.
  struct Span {
    Simplex simplex;
    std::uint64_t key;
    double from, to;
  };
  struct Segment {
    double from, to;
    int bad;
  };

  double MostWeight(std::uint32_t p) const {
    return kOmega * kOmega * (near_[p].empty() ? 0 : near_[p].front().first);
  }
  void MoreNear(std::uint32_t p, std::size_t count) {
    count = std::min(count + 1, ids_.size());
    std::vector<std::pair<double, std::uint32_t>> found(count);
    found.resize(static_cast<std::size_t>(
        FindNearest(points_.tree(), points_.Point(p), static_cast<int>(count), found.data())));
    std::erase_if(found, [p](const auto& q) { return q.second == p; });
    near_[p] = std::move(found);
  }
  bool HasAllNear(std::uint32_t p) const {
    return near_[p].size() + 1 >= ids_.size() || near_[p].size() >= kMostNear;
  }
  // How far away a point may be that cuts a star of this circumradius, squared.
  double Influence2(double most2) const {
    const double reach = kReachError * (std::sqrt(most2) + std::sqrt(most2 + most_weight_));
    return reach * reach;
  }

  // Writes the normal in p's tangent space, and returns the offset.
  double Bisector(std::uint32_t p, std::uint32_t q, double distance2, double* normal) const {
    const double *a = points_.Point(p), *b = points_.Point(q), *tangent = cloud_.Tangent(ids_[p]);
    for (int e = 0; e < K; ++e) {
      double along = 0;
      for (int i = 0; i < cloud_.d; ++i) along += tangent[e * cloud_.d + i] * (b[i] - a[i]);
      normal[e] = along;
    }
    return (distance2 + weights_[p] - weights_[q]) / 2;
  }

  static std::uint64_t KeyOf(const Simplex& s) {
    std::uint64_t key = 0;
    for (const std::uint32_t v : s) key += Mix64(v);
    return key;
  }

  const Star& StarOf(std::uint32_t p) {
    if (!stars_[p].built) Build(p);
    return stars_[p];
  }
  bool Holds(std::uint32_t q, std::uint64_t key) {
    const std::vector<std::uint64_t>& keys = StarOf(q).keys;
    return std::find(keys.begin(), keys.end(), key) != keys.end();
  }
  bool IsConsistent(std::uint32_t p) {
    const Star star = StarOf(p);
    for (std::size_t i = 0; i < star.keys.size(); ++i)
      for (const std::uint32_t q : star.simplices[i])
        if (!Holds(q, star.keys[i])) return false;
    return true;
  }

  // Whether the simplex tilts by more than 65 degrees against the tangent space at one of its
  // vertices.
  bool IsSliver(const Simplex& s, std::uint64_t key) {
    const auto [known, fresh] = slivers_.try_emplace(key, false);
    if (fresh) known->second = MeasureSliver(s);
    return known->second;
  }
  bool MeasureSliver(const Simplex& s) const {
    Eigen::MatrixXd edges(cloud_.d, K);
    for (int j = 0; j < K; ++j)
      for (int i = 0; i < cloud_.d; ++i)
        edges(i, j) = points_.Point(s[static_cast<std::size_t>(j) + 1])[i] - points_.Point(s[0])[i];
    const Eigen::Matrix<double, K, K> gram = edges.transpose() * edges;
    const Eigen::LLT<Eigen::Matrix<double, K, K>> root(gram);
    if (root.info() != Eigen::Success) return true;
    for (const std::uint32_t v : s) {
      const Eigen::Map<const Eigen::MatrixXd> tangent(cloud_.Tangent(ids_[v]), cloud_.d, K);
      Eigen::Matrix<double, K, K> cosines = edges.transpose() * tangent;
      root.matrixL().solveInPlace(cosines);
      if (!(EigenvaluesOfSymmetric(cosines * cosines.transpose())[0] > kUpright2)) return true;
    }
    return false;
  }

  // Adds the vertices of all simplices about which stars disagree and, where it exudes, of slivers.
  // Returns the number of (simplex, star) pairs.
  std::size_t FindBad(std::set<std::uint32_t>* at) {
    std::size_t bad = 0;
    for (std::uint32_t p = 0; p < ids_.size(); ++p) {
      ThrowIfInterrupted();
      const Star star = StarOf(p);
      for (std::size_t i = 0; i < star.keys.size(); ++i) {
        const Simplex& s = star.simplices[i];
        const bool held = std::all_of(s.begin(), s.end(),
                                      [&](std::uint32_t q) { return Holds(q, star.keys[i]); });
        if (held && !(exudes_ && IsSliver(s, star.keys[i]))) continue;
        ++bad;
        at->insert(s.begin(), s.end());
      }
    }
    return bad;
  }

  // Cuts a cell by the points near p, as far as they can cut. cut(q, distance2) does it.
  template <typename Begin, typename Cut, typename Most2>
  void CutByNear(std::uint32_t p, const Begin& begin, const Cut& cut, const Most2& most2) {
    for (;;) {
      begin();
      bool enough = false;
      for (const auto& [distance2, q] : near_[p]) {
        if (distance2 > Influence2(most2())) {
          enough = true;
          break;
        }
        cut(q, distance2);
      }
      if (enough || HasAllNear(p)) return;
      MoreNear(p, 2 * near_[p].size());
    }
  }

  void Build(std::uint32_t p) {
    CellMemory<K>& m = flat_;
    CutByNear(
        p, [&] { m.Begin(kCellInradius * cloud_.spacing[ids_[p]]); },
        [&](std::uint32_t q, double distance2) {
          std::array<double, K> normal;
          const double offset = Bisector(p, q, distance2, normal.data());
          m.Cut(normal, offset);
        },
        [&] { return m.cell.max_norm2(); });
    Star& star = stars_[p];
    star.built = true;
    star.simplices.clear();
    star.keys.clear();
    star.most2 = m.cell.max_norm2();
    for (std::size_t v = 0; v < m.cell.vertex_count(); ++v) {
      Simplex s;
      s[0] = p;
      bool real = true;
      for (int i = 0; i < K && real; ++i) {
        const std::uint32_t id = m.cell.id(m.cell.facet(v, i));
        real = !IsFake(id);
        if (real) s[static_cast<std::size_t>(i) + 1] = near_[p][id].second;
      }
      if (!real) continue;
      std::sort(s.begin(), s.end());
      star.simplices.push_back(s);
      star.keys.push_back(KeyOf(s));
    }
  }

  // The star of q for all weights of p with y between two limits. Returns whether p is in it.
  bool BuildForAll(std::uint32_t q, std::uint32_t p, double lower, double upper, double g,
                   std::vector<Span>* spans) {
    CellMemory<K + 1>& m = lifted_;
    std::array<double, K + 1> normal;
    CutByNear(
        q,
        [&] {
          m.Begin(kCellInradius * cloud_.spacing[ids_[q]]);
          normal.fill(0);
          normal[K] = -1;  // the limits are the first two half-spaces
          m.Cut(normal, -lower);
          normal[K] = 1;
          m.Cut(normal, upper);
        },
        [&](std::uint32_t r, double distance2) {
          const double offset = Bisector(q, r, distance2, normal.data());
          normal[K] = q == p ? -g : r == p ? g : 0;
          m.Cut(normal, offset);
        },
        [&] { return m.cell.max_norm2(); });
    bool meets = p == q;
    for (std::size_t v = 0; v < m.cell.vertex_count(); ++v)
      for (int slot = 0; slot < K + 1; ++slot) {
        const std::size_t other = m.cell.adjacent(v, slot);
        if (other <= v) continue;
        Span span;
        std::size_t count = 0;
        span.simplex[count++] = q;
        bool real = true;
        for (int i = 0; i < K + 1 && real; ++i) {
          if (i == slot) continue;
          const std::uint32_t id = m.cell.id(m.cell.facet(v, i));
          real = !IsFake(id) && id >= 2;
          if (!real) break;
          span.simplex[count++] = near_[q][id - 2].second;
          meets = meets || near_[q][id - 2].second == p;
        }
        if (!real) continue;
        std::sort(span.simplex.begin(), span.simplex.end());
        span.key = KeyOf(span.simplex);
        span.from = std::max(lower, std::min(m.cell.x(v)[K], m.cell.x(other)[K]));
        span.to = std::min(upper, std::max(m.cell.x(v)[K], m.cell.x(other)[K]));
        if (span.to > span.from) spans->push_back(span);
      }
    return meets;
  }

  // Returns between which values of y how much is bad: a simplex in some but not all of its
  // vertices' stars counts 2, a sliver 1 where it exudes. `around`: the stars that depend on y.
  std::vector<Segment> CountBad(const std::vector<std::uint32_t>& around,
                                const std::vector<Span>& spans, double lower, double upper) {
    struct Event {
      double y;
      std::size_t simplex;
      int change;
    };
    std::unordered_map<std::uint64_t, std::size_t> numbers;
    std::vector<int> holders, if_held;
    std::vector<Event> events;
    for (const Span& span : spans) {
      const auto [at, fresh] = numbers.emplace(span.key, holders.size());
      if (fresh) {
        holders.push_back(0);
        if_held.push_back(exudes_ && IsSliver(span.simplex, span.key) ? 1 : 0);
        for (const std::uint32_t v : span.simplex)
          if (std::find(around.begin(), around.end(), v) == around.end())
            holders.back() += Holds(v, span.key);
      }
      events.push_back({span.from, at->second, 1});
      events.push_back({span.to, at->second, -1});
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const Event& a, const Event& b) { return a.y < b.y; });
    const auto badness = [&](std::size_t s) {
      return holders[s] == 0 ? 0 : holders[s] < K + 1 ? 2 : if_held[s];
    };
    int bad = 0;
    for (std::size_t s = 0; s < holders.size(); ++s) bad += badness(s);
    std::vector<Segment> segments;
    double from = lower;
    const auto close = [&](double to) {
      if (to - from > kShort * (upper - lower)) {
        if (!segments.empty() && segments.back().bad == bad)
          segments.back().to = to;
        else
          segments.push_back({from, to, bad});
      }
      from = to;
    };
    for (const Event& e : events) {
      if (e.y > from) close(e.y);
      bad -= badness(e.simplex);
      holders[e.simplex] += e.change;
      bad += badness(e.simplex);
    }
    close(upper);
    return segments;
  }

  // Gives p the best weight. After the first sweep one that is only as good as the present one is
  // tried, too: it may be better for the neighbours.
  void Improve(std::uint32_t p, int sweep) {
    const double most = MostWeight(p);
    if (!(most > 0)) return;
    const double g = kOmega * std::sqrt(near_[p].front().first), now = weights_[p];
    const double lower = -(now + kBeyond * most) / (2 * g);
    const double upper = ((1 + kBeyond) * most - now) / (2 * g);
    std::vector<std::uint32_t> around{p};
    std::vector<Span> spans;
    BuildForAll(p, p, lower, upper, g, &spans);
    const auto near = near_[p];
    for (const auto& [distance2, q] : near) {
      const double most2 = StarOf(q).most2;
      const double reach = 1.05 * (std::sqrt(most2) + std::sqrt(most2 + most));
      if (distance2 > reach * reach) continue;
      std::vector<Span> own;
      if (!BuildForAll(q, p, lower, upper, g, &own)) continue;
      around.push_back(q);
      spans.insert(spans.end(), own.begin(), own.end());
    }
    const std::vector<Segment> segments = CountBad(around, spans, lower, upper);
    const Segment* const best = Choose(segments, p, sweep);
    if (!best) return;
    weights_[p] = std::clamp(now + g * (best->from + best->to), 0.0, most);
    changed_.insert(p);
    for (const std::uint32_t q : around) Build(q);
  }

  static const Segment* Choose(const std::vector<Segment>& segments, std::uint32_t p, int sweep) {
    const Segment *best = nullptr, *present = nullptr;
    for (const Segment& s : segments) {
      if (s.from <= 0 && s.to >= 0) present = &s;
      if (!best || s.bad < best->bad ||
          (s.bad == best->bad && s.to - s.from > best->to - best->from))
        best = &s;
    }
    if (!best || !present || best->bad < present->bad) return best;
    if (present->bad == 0 || sweep == 0) return nullptr;
    std::vector<const Segment*> alike;
    for (const Segment& s : segments)
      if (s.bad == present->bad && &s != present) alike.push_back(&s);
    if (alike.empty()) return nullptr;
    return alike[Mix64((std::uint64_t{p} << 20) + static_cast<std::uint64_t>(sweep)) %
                 alike.size()];
  }

  const FittedCloud& cloud_;
  const std::vector<std::uint32_t>& ids_;
  IndexedPoints points_;
  std::vector<double> weights_;
  double most_weight_ = 0;
  std::vector<std::vector<std::pair<double, std::uint32_t>>> near_;
  std::vector<Star> stars_;
  std::set<std::uint32_t> changed_;
  bool exudes_ = false;                              // whether slivers count
  std::unordered_map<std::uint64_t, bool> slivers_;  // by key
  CellMemory<K> flat_;
  CellMemory<K + 1> lifted_;
};

}  // namespace

template <int K>
std::vector<std::uint32_t> AddWeights(const FittedCloud& cloud,
                                      const std::vector<std::uint32_t>& ids,
                                      const std::vector<std::uint32_t>& centres, int sweeps,
                                      std::vector<double>* weights) {
  WeightSearch<K> search(cloud, ids, *weights);
  std::vector<std::uint32_t> own;
  own.reserve(centres.size());
  for (const std::uint32_t p : centres)
    own.push_back(
        static_cast<std::uint32_t>(std::lower_bound(ids.begin(), ids.end(), p) - ids.begin()));
  std::vector<std::uint32_t> changed;
  for (const std::uint32_t p : search.Run(own, sweeps)) {
    (*weights)[ids[p]] = search.weight(p);
    changed.push_back(ids[p]);
  }
  return changed;
}

template <int K>
ExudingWeights FindExudingWeights(const FittedCloud& cloud, FunctionRef<void(double)> done) {
  std::vector<std::uint32_t> all(cloud.size);
  std::iota(all.begin(), all.end(), 0u);
  ExudingWeights found;
  found.weights.resize(cloud.size);
  WeightSearch<K> search(cloud, all, found.weights);
  found.agree = search.RunOnAll(done);
  for (std::uint32_t p = 0; p < cloud.size; ++p) found.weights[p] = search.weight(p);
  return found;
}

template ExudingWeights FindExudingWeights<1>(const FittedCloud&, FunctionRef<void(double)>);
template ExudingWeights FindExudingWeights<2>(const FittedCloud&, FunctionRef<void(double)>);
template ExudingWeights FindExudingWeights<3>(const FittedCloud&, FunctionRef<void(double)>);

template std::vector<std::uint32_t> AddWeights<1>(const FittedCloud&,
                                                  const std::vector<std::uint32_t>&,
                                                  const std::vector<std::uint32_t>&, int,
                                                  std::vector<double>*);
template std::vector<std::uint32_t> AddWeights<2>(const FittedCloud&,
                                                  const std::vector<std::uint32_t>&,
                                                  const std::vector<std::uint32_t>&, int,
                                                  std::vector<double>*);
template std::vector<std::uint32_t> AddWeights<3>(const FittedCloud&,
                                                  const std::vector<std::uint32_t>&,
                                                  const std::vector<std::uint32_t>&, int,
                                                  std::vector<double>*);

}  // namespace stellate::core
