#include "core/reconstruction/weighted_stars.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/geometry/restricted_voronoi_cell.h"
#include "core/geometry/surroundings.h"

namespace stellate::core {
namespace {

// A weight is at most the squared distance to the nearest point, times the square of this.
constexpr double kOmega = 0.5;
// In spacings: of the simplex that a cell begins as.
constexpr double kCellInradius = 6;
constexpr std::size_t kMostNear = 2000;
constexpr double kReachError = 1 + 1e-7;
// Far above rounding, as a share of squared lengths: what cuts so nearly is tried.
constexpr double kUncertain = 1e-9;
// cos^2 of 65 degrees: what tilts by more against the tangent space at a vertex is a sliver.
constexpr double kUpright2 = 0.1786;

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

// Of each thread its own.
template <int D>
CellMemory<D>& Memory() {
  thread_local CellMemory<D> memory;
  return memory;
}

template <typename Simplex>
std::uint64_t KeyOf(const Simplex& s) {
  std::uint64_t key = 0;
  for (const std::uint32_t v : s) key += Mix64(v);
  return key;
}

}  // namespace

template <int K>
WeightedStars<K>::WeightedStars(const FittedCloud& cloud, const std::vector<std::uint32_t>& ids,
                                const std::vector<double>& weights)
    : cloud_(cloud), ids_(ids), points_(cloud.d), near_(ids.size()), stars_(ids.size()) {
  for (const std::uint32_t p : ids) {
    points_.AddUnindexed(cloud.Position(p));
    weights_.push_back(weights[p]);
  }
  points_.Index();
  constexpr std::size_t kFirstNear = K == 1 ? 8 : K == 2 ? 28 : 70;
  ParallelFor(ids.size(),
              [&](std::size_t p) { MoreNear(static_cast<std::uint32_t>(p), kFirstNear); });
  for (std::uint32_t p = 0; p < size(); ++p) most_weight_ = std::max(most_weight_, MostWeight(p));
}

template <int K>
double WeightedStars<K>::MostWeight(std::uint32_t p) const {
  return kOmega * kOmega * (near_[p].empty() ? 0 : near_[p].front().first);
}

template <int K>
void WeightedStars<K>::MoreNear(std::uint32_t p, std::size_t count) {
  count = std::min(count + 1, ids_.size());
  std::vector<std::pair<double, std::uint32_t>> found(count);
  found.resize(static_cast<std::size_t>(
      FindNearest(points_.tree(), points_.Point(p), static_cast<int>(count), found.data())));
  std::erase_if(found, [p](const auto& q) { return q.second == p; });
  near_[p] = std::move(found);
}

template <int K>
bool WeightedStars<K>::HasAllNear(std::uint32_t p) const {
  return near_[p].size() + 1 >= ids_.size() || near_[p].size() >= kMostNear;
}

// How far away a point may be that cuts a star of this circumradius, squared.
template <int K>
double WeightedStars<K>::Influence2(double most2) const {
  const double reach = kReachError * (std::sqrt(most2) + std::sqrt(most2 + most_weight_));
  return reach * reach;
}

// Writes the normal in p's tangent space, and returns the offset.
template <int K>
double WeightedStars<K>::Bisector(std::uint32_t p, std::uint32_t q, double distance2,
                                  double* normal) const {
  const double *a = points_.Point(p), *b = points_.Point(q), *tangent = cloud_.Tangent(ids_[p]);
  for (int e = 0; e < K; ++e) {
    double along = 0;
    for (int i = 0; i < cloud_.d; ++i) along += tangent[e * cloud_.d + i] * (b[i] - a[i]);
    normal[e] = along;
  }
  return (distance2 + weights_[p] - weights_[q]) / 2;
}

template <int K>
bool WeightedStars<K>::Holds(std::uint32_t q, std::uint64_t key) {
  const std::vector<std::uint64_t>& keys = StarOf(q).keys;
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

template <int K>
void WeightedStars<K>::BuildAll() {
  ParallelFor(size(), [&](std::uint32_t p) { StarOf(p); });
}

// Cuts a cell by the points near p, as far as they can cut. cut(q, distance2) does it.
template <int K>
template <typename Begin, typename Cut, typename Most2>
void WeightedStars<K>::CutByNear(std::uint32_t p, const Begin& begin, const Cut& cut,
                                 const Most2& most2) {
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

template <int K>
void WeightedStars<K>::Build(std::uint32_t p) {
  CellMemory<K>& m = Memory<K>();
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
  star.corners.clear();
  star.most2 = m.cell.max_norm2();
  for (std::size_t v = 0; v < m.cell.vertex_count(); ++v) {
    std::copy_n(m.cell.x(v), K, star.corners.emplace_back().begin());
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

// It cuts most with its largest weight.
template <int K>
bool WeightedStars<K>::MayMeet(std::uint32_t q, const Choice& choice) {
  const Star& star = stars_[q];
  std::array<double, K> normal;
  const double distance2 = SquaredDistance(points_.Point(q), points_.Point(choice.point), cloud_.d);
  const double offset =
      Bisector(q, choice.point, distance2, normal.data()) - choice.g * choice.upper;
  const double certain = offset - kUncertain * (distance2 + std::abs(offset));
  for (const auto& corner : star.corners)
    if (!(Dot(normal.data(), corner.data(), K) < certain)) return true;
  // What is known of the points near q is as much as if its star had been built for all.
  const double height = std::max(std::abs(choice.lower), std::abs(choice.upper));
  const double reach2 = Influence2(star.most2 + height * height);
  while (!(near_[q].back().first > reach2) && !HasAllNear(q)) MoreNear(q, 2 * near_[q].size());
  return false;
}

template <int K>
bool WeightedStars<K>::BuildForAll(std::uint32_t q, const Choice& choice,
                                   std::vector<Span>* spans) {
  const std::uint32_t p = choice.point;
  const double lower = choice.lower, upper = choice.upper, g = choice.g;
  CellMemory<K + 1>& m = Memory<K + 1>();
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

template <int K>
bool WeightedStars<K>::IsSliver(const Simplex& s) const {
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

template class WeightedStars<1>;
template class WeightedStars<2>;
template class WeightedStars<3>;

}  // namespace stellate::core
