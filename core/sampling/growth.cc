#include "core/sampling/growth.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/dense.h"
#include "core/base/local_maxima.h"
#include "core/base/parallel.h"
#include "core/index/near_lists.h"
#include "core/sampling/lattice.h"

namespace stellate::core {
namespace {

// An answer farther than this many spacings from its query is no neighbour: M bends away.
constexpr double kFarthestAnswer = 1;
// Tangent spaces that keep less of a frame's volume than this have turned too far to carry it on.
constexpr double kLeastVolume = 0.1;
// Points of a run lie within this many spacings of its first: of higher dimension there are more of
// them around a longer one than a search costs.
constexpr double RunReach(int k) { return k < 3 ? 4 : 1.5; }
// A lattice whose sizes differ by more than this factor from the expected ones costs more than it
// saves.
constexpr double kUnexpected = 1.25;
// So many answers decide whether the lattice is worth while: if more than this share is not as
// expected, sizes change within a spacing.
constexpr std::uint64_t kTelling = 256;
constexpr double kMostUnexpected = 0.5;
// A few points join the newest layer, until it is as large as this share of the one before.
constexpr std::size_t kLayerGrowth = 2;
// A point that is clear by more than rounding can take is not searched.
constexpr double kSurely = 1 + 1e-9;

// Makes of `frame` (K rows of d, roughly orthonormal) the orthonormal frame of the span of
// `tangent` (K orthonormal rows of d) that is nearest to it, the polar factor of its projection, by
// Newton's iteration (Higham, Functions of Matrices, Ch. 8). False where it was turned too far.
template <int K>
bool Align(const double* tangent, int d, double* frame) {
  using Rows = Eigen::Matrix<double, K, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::Map<const Rows> t(tangent, K, d);
  Eigen::Map<Rows> f(frame, K, d);
  Eigen::Matrix<double, K, K> a = f * t.transpose();
  if (!(std::abs(Determinant<K>(a)) > kLeastVolume)) return false;
  for (int step = 0; step < 5; ++step) a = 0.5 * (a + Inverse<K>(a).transpose()).eval();
  f = a * t;
  return true;
}

}  // namespace

template <int K>
void Growth<K>::Sites::Append(const Sites& others) {
  points.insert(points.end(), others.points.begin(), others.points.end());
  frames.insert(frames.end(), others.frames.begin(), others.frames.end());
  changes.insert(changes.end(), others.changes.begin(), others.changes.end());
  shares.insert(shares.end(), others.shares.begin(), others.shares.end());
  patch.insert(patch.end(), others.patch.begin(), others.patch.end());
  name.insert(name.end(), others.name.begin(), others.name.end());
}

template <int K>
Growth<K>::Proposed::Proposed(std::size_t count, std::size_t stride, bool predicts)
    : parents(count), clear(count) {
  sites.points.resize(count * stride);
  sites.frames.resize(count * stride * K);
  if (predicts) sites.changes.resize(count * stride * (K + 1));
  sites.shares.resize(count);
  sites.patch.resize(count);
  sites.name.resize(count);
}

template <int K>
Growth<K>::Layer::Layer(int d, std::vector<double> placed, std::vector<double> its_shares,
                        double reach)
    : points(std::move(placed)), shares(std::move(its_shares)), tree(points, d, reach, shares) {}

template <int K>
Growth<K>::Growth(int d, double spacing, bool predicts)
    : d_(d),
      spacing_(spacing),
      predicts_(predicts),
      vectors_(LatticeVectors(K)),
      longest_(spacing * LongestLatticeVector(K)) {
  for (double& x : vectors_) x *= spacing;
}

template <int K>
Runs Growth<K>::RunsOf(const std::vector<double>& points, const std::vector<double>& shares) const {
  return Runs(points, d_, RunReach(K) * spacing_, shares);
}

// Gathers the sampled points within their share of `radius` of some point of the run, and more.
template <int K>
void Growth<K>::GatherPlaced(const Runs& runs, std::size_t run, const std::vector<double>& shares,
                             double radius, Placed* near) const {
  near->points.clear();
  near->shares.clear();
  const auto at = [&](std::size_t i) { return shares.begin() + static_cast<std::ptrdiff_t>(i); };
  const double most = *std::max_element(at(runs.begin(run)), at(runs.end(run)));
  thread_local std::vector<std::uint32_t> ids;
  for (const auto& layer : layers_) {
    ids.clear();
    layer->tree.Gather(runs.centre(run), runs.radius(run) + most * radius, &ids);
    std::size_t to = near->points.size();
    near->points.resize(to + ids.size() * stride());
    for (const std::uint32_t id : ids) {
      std::copy_n(layer->points.data() + id * stride(), stride(), near->points.data() + to);
      near->shares.push_back(layer->shares[id]);
      to += stride();
    }
  }
}

template <int K>
std::vector<std::uint8_t> Growth<K>::AreFarFromPlaced(const std::vector<double>& points,
                                                      const std::vector<double>& shares,
                                                      double distance) const {
  std::vector<std::uint8_t> far(points.size() / stride(), 1);
  const Runs runs = RunsOf(points, shares);
  ParallelFor(runs.count(), [&](std::size_t run) {
    thread_local Placed near;
    GatherPlaced(runs, run, shares, distance, &near);
    WithDimension(d_, [&](auto known) {
      const int d = known() > 0 ? known() : d_;
      const double* const last = near.points.data() + near.points.size();
      for (std::size_t i = runs.begin(run); i < runs.end(run); ++i) {
        const double* const p = points.data() + i * stride();
        const double apart = distance * shares[i];
        const double* q = near.points.data();
        while (q != last && SquaredDistance(p, q, d) >= apart * apart) q += d;
        far[i] = q == last;
      }
    });
  });
  return far;
}

// Returns which candidates keep their distance from the sample: a candidate near a place that was
// clear of all points needs no search.
template <int K>
std::vector<std::uint8_t> Growth<K>::AreFree(const std::vector<double>& candidates,
                                             const std::vector<double>& shares,
                                             const Proposed& proposed,
                                             const std::vector<std::uint32_t>& columns) const {
  const double keep = kKeep * spacing_;
  std::vector<std::uint8_t> free(columns.size(), 1);
  std::vector<std::uint32_t> open;
  std::vector<double> points, own;
  for (std::uint32_t i = 0; i < columns.size(); ++i) {
    CheckInterruption(i);
    const double* const y = candidates.data() + i * stride();
    const double* const asked = proposed.sites.points.data() + columns[i] * stride();
    const double clear = proposed.clear[columns[i]] - Distance(y, asked, d_);
    if (clear > kSurely * (keep * shares[i])) continue;
    open.push_back(i);
    points.insert(points.end(), y, y + d_);
    own.push_back(shares[i]);
  }
  const std::vector<std::uint8_t> far = AreFarFromPlaced(points, own, keep);
  for (std::size_t i = 0; i < open.size(); ++i) free[open[i]] = far[i];
  return free;
}

// Chooses, of the answers `candidates` to proposals, d each, with their shares, in the order of
// `columns`, those that keep their distance from the sample and from each other. Proposals of more
// parents come first: they are more likely at their place in the lattice.
template <int K>
std::vector<std::uint32_t> Growth<K>::Choose(const std::vector<double>& candidates,
                                             const std::vector<double>& shares,
                                             const Proposed& proposed,
                                             const std::vector<std::uint32_t>& columns) const {
  const double keep = kKeep * spacing_;
  const std::vector<std::uint8_t> far = AreFree(candidates, shares, proposed, columns);
  const NearLists near(candidates, d_, keep, shares);
  const auto strength = [&](std::uint32_t i) {
    const std::uint32_t c = columns[i];
    return std::pair(-static_cast<int>(proposed.parents[c]), i);
  };
  const std::vector<std::uint8_t> chosen =
      ChooseLocalMaxima(columns.size(), [&](std::size_t i, const auto& visit) {
        if (!far[i]) return;
        for (const std::uint32_t j : near.Of(i))
          if (far[j] && strength(j) < strength(static_cast<std::uint32_t>(i)) && !visit(j)) return;
      });
  std::vector<std::uint32_t> taken;
  for (std::uint32_t i = 0; i < columns.size(); ++i) {
    CheckInterruption(i);
    if (chosen[i] && far[i]) taken.push_back(i);
  }
  return taken;
}

template <int K>
typename Growth<K>::Sites Growth<K>::SitesOf(const Proposed& proposed,
                                             const std::vector<std::uint32_t>& columns) const {
  Sites sites;
  for (const std::uint32_t c : columns) {
    CheckInterruption(sites.size());
    const double* const point = proposed.sites.points.data() + c * stride();
    const double* const frame = proposed.sites.frames.data() + c * stride() * K;
    sites.points.insert(sites.points.end(), point, point + stride());
    sites.frames.insert(sites.frames.end(), frame, frame + stride() * K);
    const double* const change = proposed.sites.changes.data() + c * change_stride();
    sites.changes.insert(sites.changes.end(), change, change + change_stride());
    sites.shares.push_back(proposed.sites.shares[c]);
    sites.patch.push_back(proposed.sites.patch[c]);
    sites.name.push_back(proposed.sites.name[c]);
  }
  return sites;
}

template <int K>
typename Growth<K>::Ring Growth<K>::Propose() {
  const bool is_lost = answered_ > kTelling && static_cast<double>(unexpected_) >
                                                   kMostUnexpected * static_cast<double>(answered_);
  asked_ = is_lost ? Proposed() : Merge(ByPlace(FreePlaces()));
  border_ = {};
  const auto count = static_cast<Eigen::Index>(asked_.sites.size());
  Ring ring{Eigen::Map<const Eigen::MatrixXd>(asked_.sites.points.data(), d_, count),
            Eigen::Map<const Eigen::MatrixXd>(asked_.sites.frames.data(), d_ * K, count),
            {}};
  if (!predicts_) return ring;
  const Eigen::Map<const Eigen::MatrixXd> changes(asked_.sites.changes.data(), d_ * (K + 1), count);
  ring.bends = changes.topRows(d_);
  ring.tangents += changes.bottomRows(d_ * K);
  ring.spacing = spacing_ * Eigen::Map<const Eigen::VectorXd>(asked_.sites.shares.data(), count);
  return ring;
}

// Writes how the answer to a proposal, and the frame there, differ from what was proposed.
template <int K>
void Growth<K>::NoteChange(std::size_t asked, const double* point, const double* frame) {
  double* const change = asked_.sites.changes.data() + asked * change_stride();
  const double* const proposed = asked_.sites.points.data() + asked * stride();
  const double* const proposed_frame = asked_.sites.frames.data() + asked * stride() * K;
  for (std::size_t j = 0; j < stride(); ++j) change[j] = point[j] - proposed[j];
  for (std::size_t j = 0; j < stride() * K; ++j)
    change[stride() + j] = frame[j] - proposed_frame[j];
}

// Keeps the share of the answer to query `asked`, if it is about as expected.
template <int K>
bool Growth<K>::IsExpected(std::size_t asked, double share) {
  const double expected = std::exchange(asked_.sites.shares[asked], share);
  const bool is = share <= kUnexpected * expected && expected <= kUnexpected * share;
  ++answered_;
  unexpected_ += !is;
  return is;
}

template <int K>
void Growth<K>::Forget() {
  layers_.clear();
  border_ = {};
  asked_ = Proposed();
}

// Appends sites to the sample, which grows on from them.
template <int K>
void Growth<K>::Carry(Sites sites) {
  border_.Append(sites);
  size_ += static_cast<std::uint32_t>(sites.size());
  if (sites.size() == 0) return;
  std::vector<double> points = std::move(sites.points), shares = std::move(sites.shares);
  const auto append = [](std::vector<double>* to, std::vector<double>* from) {
    to->insert(to->end(), from->begin(), from->end());
    *from = std::move(*to);
  };
  while (!layers_.empty() && kLayerGrowth * points.size() >= layers_.back()->points.size()) {
    append(&layers_.back()->points, &points);
    append(&layers_.back()->shares, &shares);
    layers_.pop_back();
  }
  layers_.push_back(
      std::make_unique<Layer>(d_, std::move(points), std::move(shares), RunReach(K) * spacing_));
}

template <int K>
std::vector<Eigen::Index> Growth<K>::Begin(const Eigen::MatrixXd& points,
                                           const Eigen::MatrixXd& tangents,
                                           const std::vector<std::uint8_t>& found, double apart,
                                           const Eigen::VectorXd& shares, double clearance) {
  is_graded_ = is_graded_ || shares.size() > 0;
  std::vector<Eigen::Index> columns;
  std::vector<double> candidates, own;
  for (Eigen::Index c = 0; c < points.cols(); ++c) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (!found[static_cast<std::size_t>(c)]) continue;
    columns.push_back(c);
    candidates.insert(candidates.end(), points.col(c).begin(), points.col(c).end());
    own.push_back(shares.size() > 0 ? shares[c] : 1);
  }
  const std::vector<std::uint8_t> far = AreFarFromPlaced(candidates, own, clearance * spacing_);
  Sites seeds;
  BallTree tree(d_, &seeds.points);
  std::vector<Eigen::Index> begun;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    CheckInterruption(i);
    const double* const y = candidates.data() + i * stride();
    if (!far[i] || tree.AnyWithin(y, own[i] * apart)) continue;
    begun.push_back(columns[i]);
    seeds.points.insert(seeds.points.end(), y, y + d_);
    tree.Insert(0);
    const auto frame = tangents.col(columns[i]);
    seeds.frames.insert(seeds.frames.end(), frame.begin(), frame.end());
    seeds.changes.resize(seeds.changes.size() + change_stride());
    seeds.shares.push_back(own[i]);
    seeds.patch.push_back(patches_++);
    seeds.name.push_back(names_.origin());
  }
  Carry(std::move(seeds));
  return begun;
}

template <int K>
std::vector<Eigen::Index> Growth<K>::Join(const Eigen::MatrixXd& points,
                                          const Eigen::MatrixXd& tangents,
                                          const std::vector<std::uint8_t>& found,
                                          const Eigen::VectorXd& shares) {
  const std::size_t count = asked_.sites.size();
  double* const frames = asked_.sites.frames.data();
  std::vector<std::uint8_t> fits(count);
  ParallelFor(count, [&](std::size_t i) {
    const auto c = static_cast<Eigen::Index>(i);
    const double* const proposed = asked_.sites.points.data() + i * stride();
    const double farthest = asked_.sites.shares[i] * (kFarthestAnswer * spacing_);
    double* const frame = frames + i * stride() * K;
    if (!found[i] || Distance(points.col(c).data(), proposed, d_) > farthest) return;
    thread_local std::vector<double> aligned;
    aligned.assign(frame, frame + stride() * K);
    fits[i] = Align<K>(tangents.col(c).data(), d_, aligned.data());
    if (!fits[i]) return;
    if (predicts_) NoteChange(i, points.col(c).data(), aligned.data());
    std::copy(aligned.begin(), aligned.end(), frame);
  });
  std::vector<std::uint32_t> columns;
  std::vector<double> candidates, own;
  for (std::uint32_t i = 0; i < count; ++i) {
    CheckInterruption(i);
    if (!fits[i] || (shares.size() > 0 && !IsExpected(i, shares[i]))) continue;
    columns.push_back(i);
    own.push_back(asked_.sites.shares[i]);
    candidates.insert(candidates.end(), points.col(i).begin(), points.col(i).end());
  }
  std::vector<std::uint32_t> joined = Choose(candidates, own, asked_, columns);
  for (std::uint32_t& i : joined) i = columns[i];
  Sites sites = SitesOf(asked_, joined);
  for (std::size_t i = 0; i < joined.size(); ++i)
    std::copy_n(points.col(joined[i]).data(), d_, sites.points.data() + i * stride());
  asked_ = Proposed();
  Carry(std::move(sites));
  return {joined.begin(), joined.end()};
}

STELLATE_INSTANTIATE_CLASS(Growth)

}  // namespace stellate::core
