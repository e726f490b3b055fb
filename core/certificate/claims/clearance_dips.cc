#include "core/certificate/claims/clearance_dips.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/base/parallel.h"
#include "core/base/vector_ops.h"

namespace stellate::core {
namespace {

// A clearance is a dip if it is this share, or less, of what so many points near it predict.
constexpr double kDip = 0.85;
constexpr std::size_t kPointsNear = 8;
constexpr std::size_t kLookedAt = 6 * kPointsNear;  // most lie where others lie
constexpr double kApart = 0.25;  // of the mesh size: what is nearer is in the same dip
constexpr double kAround = 1;    // of the mesh size: mostly, so many are there
// In mesh sizes: so near to a wall the distance from the wall's mesh is a poor estimate of that
// from the wall.
constexpr double kBeside = 0.15;
constexpr double kAfar = 4;  // of the largest radius of the mesh's simplices
// A rough share is this part, at least, of the exact one. Nearer to 1 more searches are long, and
// nearer to kDip more shares are needed exactly.
constexpr double kRough = 0.92;

}  // namespace

double ClearanceDips::Share::Most() const { return is_exact ? least : least / kRough; }

// The nearest barycentre is at most as far as that of some simplex, and if none is much nearer, it
// is about as far.
ClearanceDips::Share ClearanceDips::Rough(std::size_t n, std::uint32_t some) const {
  const double clear = clear_.clearances[n * walls_ + wall_];
  if (clear == 0) return {};
  const double* const y = Point(n);
  const int d = sheet_.mesh.d;
  const double* const barycentre = sheet_.barycentres.data() + some * static_cast<std::size_t>(d);
  const double most = Distance(y, barycentre, d), least = kRough * most;
  if (least > std::max(kAfar * sheet_.largest_radius, kBeside * size_) &&
      !sheet_.tree.AnyWithin(y, least))
    return {clear / most, false};
  return Exact(n);
}

// Takes the shares of the points that have none yet. What is near one of a bunch is near the rest.
void ClearanceDips::TakeShares(const BallTree& tree) {
  const std::size_t first = shares_.size();
  shares_.resize(tree.size());
  const std::vector<BallTree::Bunch> bunches = tree.Bunches();
  ParallelFor(bunches.size(), [&](std::size_t b) {
    const BallTree::Bunch& bunch = bunches[b];
    const std::span<const std::uint32_t> ids(bunch.ids, bunch.count);
    if (std::all_of(ids.begin(), ids.end(), [&](std::uint32_t n) { return n < first; })) return;
    const std::uint32_t some = sheet_.SomeNear(bunch.centre);
    for (const std::uint32_t n : ids)
      if (n >= first) shares_[n] = Rough(n, some);
  });
}

// From afar a barycentre is about as far as its simplex.
ClearanceDips::Share ClearanceDips::Exact(std::size_t n) const {
  const double* const y = Point(n);
  const double far = sheet_.tree.AnyWithin(y, kAfar * sheet_.largest_radius)
                         ? sheet_.DistanceFrom(y)
                         : std::sqrt(NearestSquaredDistance(sheet_.tree, y));
  return {far > kBeside * size_ ? clear_.clearances[n * walls_ + wall_] / far : 0, true};
}

// Returns the clear points nearest to q that are no nearer to it, or to each other, than kApart,
// nearest first. A place that was queried often must not outvote the rest.
std::vector<std::uint32_t> ClearanceDips::NearestApart(const BallTree& tree,
                                                       const double* q) const {
  const int d = sheet_.mesh.d;
  const double apart2 = kApart * size_ * kApart * size_;
  std::vector<std::uint32_t> near, ids;
  std::vector<std::pair<double, std::uint32_t>> nearest;
  for (double radius = kAround * size_;; radius *= 2) {
    near.clear();
    tree.Gather(q, radius, &near);
    nearest.clear();
    for (const std::uint32_t other : near) {
      const double squared = SquaredDistance(q, Point(other), d);
      if (squared >= apart2 && shares_[other].least != 0) nearest.emplace_back(squared, other);
    }
    std::sort(nearest.begin(), nearest.end());
    ids.clear();
    std::size_t seen = 0;
    for (; seen < std::min(nearest.size(), kLookedAt) && ids.size() < kPointsNear; ++seen) {
      const std::uint32_t other = nearest[seen].second;
      const bool is_apart = std::none_of(ids.begin(), ids.end(), [&](std::uint32_t taken) {
        return SquaredDistance(Point(taken), Point(other), d) < apart2;
      });
      if (is_apart) ids.push_back(other);
    }
    if (ids.size() == kPointsNear || seen == kLookedAt || near.size() == tree.size()) return ids;
  }
}

// Returns the least that the share of n may be of the median of the most that these may be.
double ClearanceDips::DipAt(std::uint32_t n, const std::vector<std::uint32_t>& near) const {
  if (near.empty()) return 1;
  std::vector<double> most;
  most.reserve(near.size());
  for (const std::uint32_t other : near) most.push_back(shares_[other].Most());
  const auto middle = most.begin() + static_cast<std::ptrdiff_t>(most.size() / 2);
  std::nth_element(most.begin(), middle, most.end());
  return shares_[n].least / *middle;
}

// Returns the points from `first` on that may be dips as far as shares are known.
std::vector<ClearanceDips::Candidate> ClearanceDips::Candidates(const BallTree& tree,
                                                                std::size_t first) const {
  double most = 0;
  for (const Share& share : shares_) most = std::max(most, share.Most());
  return ParallelGather<Candidate>(shares_.size() - first,
                                   [&](std::size_t i, std::vector<Candidate>* candidates) {
                                     const auto n = static_cast<std::uint32_t>(first + i);
                                     if (shares_[n].least == 0 || shares_[n].least > kDip * most)
                                       return;
                                     std::vector<std::uint32_t> near = NearestApart(tree, Point(n));
                                     if (DipAt(n, near) <= kDip)
                                       candidates->push_back({n, std::move(near)});
                                   });
}

void ClearanceDips::MakeExact(const std::vector<Candidate>& candidates) {
  std::vector<std::uint32_t> rough;
  const auto add = [&](std::uint32_t n) {
    if (std::exchange(shares_[n].is_exact, true)) return;
    rough.push_back(n);
  };
  for (const Candidate& candidate : candidates) {
    add(candidate.n);
    for (const std::uint32_t other : candidate.near) add(other);
  }
  ParallelFor(rough.size(), [&](std::size_t i) { shares_[rough[i]] = Exact(rough[i]); });
}

std::vector<std::uint32_t> ClearanceDips::Find(const BallTree& tree, std::size_t most) {
  const std::size_t first = shares_.size();
  TakeShares(tree);
  const std::vector<Candidate> candidates = Candidates(tree, first);
  MakeExact(candidates);
  std::vector<std::pair<double, std::uint32_t>> dips;
  for (const Candidate& candidate : candidates) {
    const double dip = DipAt(candidate.n, candidate.near);
    if (dip <= kDip) dips.emplace_back(dip, candidate.n);
  }
  std::sort(dips.begin(), dips.end());
  std::vector<std::uint32_t> ids;
  for (std::size_t i = 0; i < std::min(dips.size(), most); ++i) ids.push_back(dips[i].second);
  return ids;
}

}  // namespace stellate::core
