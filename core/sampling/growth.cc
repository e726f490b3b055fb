#include "core/sampling/growth.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/parallel_copy.h"
#include "core/base/parallel_select.h"
#include "core/index/near_lists.h"
#include "core/parts/choice.h"
#include "core/sampling/lattice.h"

namespace stellate::core {
namespace {

// Tangent spaces that keep less of a frame's volume than this have turned too far to carry it on.
constexpr double kLeastVolume = 0.1;
// Points of a run lie within this many spacings of its first: of higher dimension there are more of
// them around a longer one than a search costs.
constexpr double RunReach(int k) { return k < 3 ? 4 : 1.5; }
// A lattice whose sizes differ by more than this factor from the expected ones costs more than it
// saves.
constexpr double kMostOff = 1.25;
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
void Growth<K>::Sites::Resize(std::size_t count, std::size_t stride, bool predicts) {
  points.resize(count * stride);
  frames.resize(count * stride * K);
  changes.resize(predicts ? count * stride * (K + 1) : 0);
  shares.resize(count);
  patch.resize(count);
  name.resize(count);
}

template <int K>
void Growth<K>::Sites::Put(std::size_t at, const Sites& others,
                           const std::vector<std::uint32_t>& columns) {
  const std::size_t stride = others.size() == 0 ? 0 : others.points.size() / others.size();
  const std::size_t change_stride = others.changes.empty() ? 0 : stride * (K + 1);
  ParallelFor(columns.size(), [&](std::size_t i) {
    const auto from = static_cast<std::size_t>(columns[i]), to = at + i;
    const auto copy = [&](const Numbers& source, std::size_t each, Numbers* target) {
      std::copy_n(source.data() + from * each, each, target->data() + to * each);
    };
    copy(others.points, stride, &points);
    copy(others.frames, stride * K, &frames);
    copy(others.changes, change_stride, &changes);
    shares[to] = others.shares[from];
    patch[to] = others.patch[from];
    name[to] = others.name[from];
  });
}

template <int K>
Growth<K>::Proposed::Proposed(std::size_t count, std::size_t stride, bool predicts)
    : parents(count), first(count), clear(count) {
  sites.Resize(count, stride, predicts);
}

template <int K>
Growth<K>::Layer::Layer(int d, Numbers placed, Numbers its_shares, double reach)
    : points(std::move(placed)), shares(std::move(its_shares)), tree(points, d, reach, shares) {}

template <int K>
Growth<K>::Growth(int d, double spacing, bool predicts, Territory territory)
    : d_(d),
      spacing_(spacing),
      predicts_(predicts),
      territory_(std::move(territory)),
      vectors_(LatticeVectors(K)),
      longest_(spacing * LongestLatticeVector(K)) {
  for (double& x : vectors_) x *= spacing;
}

template <int K>
Runs Growth<K>::RunsOf(const Numbers& points, const Numbers& shares) const {
  return Runs(points, d_, RunReach(K) * spacing_, shares);
}

// Gathers the sampled points within their share of `radius` of some point of the run, and more.
template <int K>
void Growth<K>::GatherPlaced(const Runs& runs, std::size_t run, const Numbers& shares,
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
std::vector<std::uint8_t> Growth<K>::AreFarFromPlaced(const Numbers& points, const Numbers& shares,
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

template <int K>
typename Growth<K>::Candidates Growth<K>::CandidatesOf(const Eigen::MatrixXd& points,
                                                       std::span<const double> shares,
                                                       std::vector<std::uint32_t> columns) const {
  Candidates candidates{std::move(columns), {}, {}};
  const std::vector<std::uint32_t>& of = candidates.columns;
  candidates.points.resize(of.size() * stride());
  candidates.shares.resize(of.size());
  ParallelFor(of.size(), [&](std::size_t i) {
    std::copy_n(points.col(of[i]).data(), d_, candidates.points.data() + i * stride());
    candidates.shares[i] = shares.empty() ? 1 : shares[of[i]];
  });
  return candidates;
}

// Returns which candidates keep their distance from the sample: a candidate near a place that was
// clear of all points needs no search.
template <int K>
std::vector<std::uint8_t> Growth<K>::AreFree(const Candidates& candidates,
                                             const Proposed& proposed) const {
  const double keep = kKeep * spacing_;
  const std::vector<std::uint32_t>& columns = candidates.columns;
  const auto at = [&](std::size_t i) { return candidates.points.data() + i * stride(); };
  const std::vector<std::uint32_t> open =
      ParallelGather<std::uint32_t>(columns.size(), [&](std::size_t i, auto* found) {
        const double* const asked = proposed.sites.points.data() + columns[i] * stride();
        const double clear = proposed.clear[columns[i]] - Distance(at(i), asked, d_);
        if (!(clear > kSurely * (keep * candidates.shares[i])))
          found->push_back(static_cast<std::uint32_t>(i));
      });
  Numbers points(open.size() * stride()), own(open.size());
  ParallelFor(open.size(), [&](std::size_t i) {
    std::copy_n(at(open[i]), d_, points.data() + i * stride());
    own[i] = candidates.shares[open[i]];
  });
  const std::vector<std::uint8_t> far = AreFarFromPlaced(points, own, keep);
  std::vector<std::uint8_t> free(columns.size(), 1);
  ParallelFor(open.size(), [&](std::size_t i) { free[open[i]] = far[i]; });
  return free;
}

template <int K>
typename Growth<K>::Contenders Growth<K>::ContendersOf(const Candidates& candidates,
                                                       const Proposed& proposed) const {
  const std::vector<std::uint8_t> free = AreFree(candidates, proposed);
  const std::vector<std::uint32_t> left =
      ParallelSelect(free.size(), [&](std::size_t i) { return free[i] != 0; });
  Contenders contenders{std::vector<std::uint32_t>(left.size()), std::vector<int>(left.size()),
                        Numbers(left.size() * stride()), Numbers(left.size())};
  ParallelFor(left.size(), [&](std::size_t i) {
    contenders.columns[i] = candidates.columns[left[i]];
    contenders.parents[i] = proposed.parents[contenders.columns[i]];
    std::copy_n(candidates.points.data() + left[i] * stride(), d_,
                contenders.points.data() + i * stride());
    contenders.shares[i] = candidates.shares[left[i]];
  });
  return contenders;
}

// Chooses those of the candidates that keep their distance from the sample and from each other, and
// returns their columns, ascending. Proposals of more parents come first: they are more likely at
// their place in the lattice.
template <int K>
std::vector<std::uint32_t> Growth<K>::Choose(const Candidates& candidates,
                                             const Proposed& proposed) const {
  Contenders all = ContendersOf(candidates, proposed);
  const Borders borders = ShareContenders(proposed, &all);
  const NearLists near(all.points, d_, kKeep * spacing_, all.shares);
  const auto strength = [&](std::uint32_t i) { return std::pair(-all.parents[i], i); };
  const std::vector<std::uint8_t> is_chosen = ChooseLocalMaxima(
      territory_.peers(), borders, all.columns.size(), [&](std::size_t i, const auto& visit) {
        for (const std::uint32_t j : near.Of(i))
          if (strength(j) < strength(static_cast<std::uint32_t>(i)) && !visit(j)) return;
      });
  std::vector<std::uint32_t> chosen = ParallelSelect(all.columns.size(), [&](std::size_t i) {
    return is_chosen[i] && all.columns[i] != kNoColumn;
  });
  for (std::uint32_t& i : chosen) i = all.columns[i];
  return chosen;
}

template <int K>
typename Growth<K>::Ring Growth<K>::Propose() {
  const bool is_lost = answered_ > kTelling && static_cast<double>(unexpected_) >
                                                   kMostUnexpected * static_cast<double>(answered_);
  asked_ = Proposed();
  if (!is_lost) {
    Proposed places = ByPlace(FreePlaces());
    const Borders borders = SharePlaces(&places);
    asked_ = Merge(std::move(places), borders);
  }
  border_ = {};
  const Sites& sites = asked_.sites;
  const auto count = static_cast<Eigen::Index>(sites.size());
  const auto copy = [count](const Numbers& from, Eigen::Index rows) {
    Eigen::MatrixXd to(rows, count);
    ParallelCopy(from.data(), from.size(), to.data());
    return to;
  };
  Ring ring{copy(sites.points, d_), copy(sites.frames, d_ * K), {}};
  if (!predicts_) return ring;
  ring.bends.resize(d_, count);
  ring.spacing.resize(count);
  const Eigen::Map<const Eigen::MatrixXd> changes(sites.changes.data(), d_ * (K + 1), count);
  ParallelFor(count, [&](Eigen::Index i) {
    ring.bends.col(i) = changes.col(i).head(d_);
    ring.tangents.col(i) += changes.col(i).tail(d_ * K);
    ring.spacing[i] = spacing_ * sites.shares[static_cast<std::size_t>(i)];
  });
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

template <int K>
void Growth<K>::Forget() {
  layers_.clear();
  border_ = {};
  asked_ = Proposed();
}

// Appends sites to the sample, which grows on from them.
template <int K>
void Growth<K>::Carry(Sites sites) {
  size_ += static_cast<std::uint32_t>(sites.size());
  if (sites.size() == 0) return;
  std::size_t first = layers_.size(), count = sites.size();
  while (first > 0 && kLayerGrowth * count >= layers_[first - 1]->shares.size())
    count += layers_[--first]->shares.size();
  Numbers points(count * stride()), shares(count);
  std::size_t at = 0;
  const auto append = [&](const Numbers& its_points, const Numbers& its_shares) {
    ParallelCopy(its_points.data(), its_points.size(), points.data() + at * stride());
    ParallelCopy(its_shares.data(), its_shares.size(), shares.data() + at);
    at += its_shares.size();
  };
  for (std::size_t l = first; l < layers_.size(); ++l)
    append(layers_[l]->points, layers_[l]->shares);
  append(sites.points, sites.shares);
  layers_.resize(first);
  layers_.push_back(
      std::make_unique<Layer>(d_, std::move(points), std::move(shares), RunReach(K) * spacing_));
  if (border_.size() == 0) {
    border_ = std::move(sites);
    return;
  }
  std::vector<std::uint32_t> all(sites.size());
  std::iota(all.begin(), all.end(), 0u);
  const std::size_t before = border_.size();
  Sites both;
  both.Resize(before + all.size(), stride(), predicts_);
  both.Put(before, sites, all);
  all.resize(before);
  std::iota(all.begin(), all.end(), 0u);
  both.Put(0, border_, all);
  border_ = std::move(both);
}

template <int K>
std::vector<Eigen::Index> Growth<K>::Begin(const Eigen::MatrixXd& points,
                                           const Eigen::MatrixXd& tangents,
                                           const std::vector<std::uint8_t>& found, double apart,
                                           const Eigen::VectorXd& shares, double clearance) {
  is_graded_ = is_graded_ || shares.size() > 0;
  std::vector<std::uint32_t> answered;
  for (std::uint32_t c = 0; c < points.cols(); ++c) {
    CheckInterruption(c);
    if (found[c]) answered.push_back(c);
  }
  const std::span<const double> given(shares.data(), static_cast<std::size_t>(shares.size()));
  const Candidates candidates = CandidatesOf(points, given, std::move(answered));
  std::vector<std::uint8_t> far =
      AreFarFromPlaced(candidates.points, candidates.shares, clearance * spacing_);
  ShareFar(candidates, &far);
  std::vector<double> begun;
  BallTree tree(d_, &begun);
  std::vector<std::size_t> seeds;
  for (std::size_t i = 0; i < far.size(); ++i) {
    CheckInterruption(i);
    const double* const y = candidates.points.data() + i * stride();
    if (!far[i] || tree.AnyWithin(y, candidates.shares[i] * apart)) continue;
    seeds.push_back(i);
    begun.insert(begun.end(), y, y + d_);
    tree.Insert(0);
  }
  Sites sites;
  sites.Resize(seeds.size(), stride(), predicts_);
  std::copy(begun.begin(), begun.end(), sites.points.begin());
  std::fill(sites.changes.begin(), sites.changes.end(), 0.0);
  std::fill(sites.name.begin(), sites.name.end(), names_.origin());
  std::vector<Eigen::Index> columns;
  for (const std::size_t i : seeds) {
    const std::size_t at = columns.size();
    columns.push_back(candidates.columns[i]);
    const auto frame = tangents.col(columns.back());
    std::copy(frame.begin(), frame.end(), sites.frames.data() + at * stride() * K);
    sites.shares[at] = candidates.shares[i];
    sites.patch[at] = patches_++;
  }
  KeepNear(&sites);
  Carry(std::move(sites));
  return columns;
}

// Turns frames to the tangent spaces of the answers, and keeps their shares.
template <int K>
std::vector<typename Growth<K>::Fit> Growth<K>::FitAnswers(const Eigen::MatrixXd& points,
                                                           const Eigen::MatrixXd& tangents,
                                                           const std::vector<std::uint8_t>& found,
                                                           const Eigen::VectorXd& shares) {
  Sites& asked = asked_.sites;
  std::vector<Fit> fits(asked.size(), kMisfit);
  ParallelFor(asked.size(), [&](std::size_t i) {
    const auto c = static_cast<Eigen::Index>(i);
    const double* const proposed = asked.points.data() + i * stride();
    const double farthest = asked.shares[i] * (kFarthestAnswer * spacing_);
    double* const frame = asked.frames.data() + i * stride() * K;
    if (!found[i] || Distance(points.col(c).data(), proposed, d_) > farthest) return;
    thread_local std::vector<double> aligned;
    aligned.assign(frame, frame + stride() * K);
    if (!Align<K>(tangents.col(c).data(), d_, aligned.data())) return;
    if (predicts_) NoteChange(i, points.col(c).data(), aligned.data());
    std::copy(aligned.begin(), aligned.end(), frame);
    fits[i] = kFits;
    if (shares.size() == 0) return;
    const double expected = std::exchange(asked.shares[i], shares[c]);
    if (!(shares[c] <= kMostOff * expected && expected <= kMostOff * shares[c]))
      fits[i] = kUnexpected;
  });
  if (shares.size() == 0) return fits;
  const auto count = [&](Fit fit) {
    return static_cast<std::uint64_t>(std::count(fits.begin(), fits.end(), fit));
  };
  answered_ += count(kFits) + count(kUnexpected);
  unexpected_ += count(kUnexpected);
  return fits;
}

template <int K>
std::vector<Eigen::Index> Growth<K>::Join(const Eigen::MatrixXd& points,
                                          const Eigen::MatrixXd& tangents,
                                          const std::vector<std::uint8_t>& found,
                                          const Eigen::VectorXd& shares) {
  const std::vector<Fit> fits = FitAnswers(points, tangents, found, shares);
  const Candidates candidates =
      CandidatesOf(points, asked_.sites.shares,
                   ParallelSelect(fits.size(), [&](std::size_t i) { return fits[i] == kFits; }));
  const std::vector<std::uint32_t> chosen = Choose(candidates, asked_);
  Sites sites;
  sites.Resize(chosen.size(), stride(), predicts_);
  sites.Put(0, asked_.sites, chosen);
  std::vector<Eigen::Index> joined(chosen.size());
  ParallelFor(chosen.size(), [&](std::size_t i) {
    joined[i] = chosen[i];
    std::copy_n(points.col(joined[i]).data(), d_, sites.points.data() + i * stride());
  });
  std::vector<OrderKey> keys;
  if (!territory_.is_whole())
    for (const std::uint32_t c : chosen) keys.push_back(asked_.KeyOf(c));
  asked_ = Proposed();
  CarryToAll(keys, std::move(sites));
  return joined;
}

STELLATE_INSTANTIATE_CLASS(Growth)

}  // namespace stellate::core
