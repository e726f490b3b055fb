// How a lattice is continued.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/base/dense.h"
#include "core/base/parallel.h"
#include "core/base/parallel_select.h"
#include "core/base/parallel_sort.h"
#include "core/index/near_lists.h"
#include "core/parts/choice.h"
#include "core/sampling/growth.h"

namespace stellate::core {
namespace {

// The least second moment of the sampled points around a point, in its spacings squared: if it is
// less in a direction, sizes are taken to change little along it.
constexpr double kLeastMoment = 0.05;
// Simplices follow the smallest size at their vertices: where sizes change, the spacing is smaller
// by this share of the change in a spacing, at most by half.
constexpr double kSlopeMargin = 0.3;
constexpr double kLeastStep = 0.5;
// Points are gathered this many spacings farther around a place than those that would take it: the
// answer lies a little beside the place, and mostly needs no search then. Only near points decide
// slopes.
constexpr double Beside(bool is_graded) { return is_graded ? 0 : 0.15; }

// Fits how shares change from that of a point, by least squares over the sampled points around it:
// coordinates along its frame, the squared distance across, and the share, each.
template <int K>
Eigen::Matrix<double, K, 1> SlopeOf(const double* begin, const double* end, double share,
                                    double spacing) {
  using Vector = Eigen::Matrix<double, K, 1>;
  Eigen::Matrix<double, K, K> moments = Eigen::Matrix<double, K, K>::Identity();
  moments *= kLeastMoment * share * share * spacing * spacing;
  Vector changes = Vector::Zero();
  for (const double* at = begin; at != end; at += K + 2) {
    const Eigen::Map<const Vector> along(at);
    moments += along * along.transpose();
    changes += along * (at[K + 1] - share);
  }
  return SolveSymmetric(moments, changes);
}

}  // namespace

// Writes the place of a proposal: its parent's neighbour in the lattice, in the parent's tangent
// space.
template <int K>
void Growth<K>::Land(const Proposal& proposal, double* point) const {
  const double* const vector = vectors_.data() + std::size_t{proposal.direction} * K;
  const double* const frame = border_.frames.data() + proposal.parent * stride() * K;
  const double* const from = border_.points.data() + proposal.parent * stride();
  for (int j = 0; j < d_; ++j) {
    double x = from[j];
    for (int a = 0; a < K; ++a) x += proposal.share * vector[a] * frame[a * d_ + j];
    point[j] = x;
  }
}

// Compares in the parent's own coordinates. Towards smaller sizes it goes no farther than the size
// at the new place allows.
template <int K>
void Growth<K>::ProposeFrom(std::uint32_t p, const Placed& near,
                            std::vector<Proposal>* free) const {
  const double* const from = border_.points.data() + p * stride();
  const double* const frame = border_.frames.data() + p * stride() * K;
  const double share = border_.shares[p];
  const double keep = share * (kKeep * spacing_);
  const double far = share * (longest_ + Beside(is_graded_) * spacing_) + keep;
  thread_local std::vector<double> coordinates, steps;
  coordinates.resize(near.shares.size() * (K + 2));
  steps.resize(stride());
  const double* const begin = coordinates.data();
  const double* const end = WithDimension(d_, [&](auto known) {
    const int d = known() > 0 ? known() : d_;
    double* to = coordinates.data();
    double* const step = steps.data();
    const double* q = near.points.data();
    for (const double other : near.shares) {
      for (int j = 0; j < d; ++j) step[j] = *q++ - from[j];
      const double distance2 = Dot(step, step, d);
      if (distance2 > far * far || distance2 == 0) continue;
      double across2 = distance2;
      for (int a = 0; a < K; ++a) {
        const double along = Dot(frame + a * d, step, d);
        *to++ = along;
        across2 -= along * along;
      }
      *to++ = across2;
      *to++ = other;
    }
    return to;
  });
  Eigen::Matrix<double, K, 1> slope = Eigen::Matrix<double, K, 1>::Zero();
  if (is_graded_) slope = SlopeOf<K>(begin, end, share, spacing_);
  const double steepest = 1 - kSlopeMargin * spacing_ * slope.norm();
  constexpr std::size_t kDirections = (std::size_t{2} << K) - 2;
  double step[kDirections], length2[kDirections], place[K][kDirections], nearest2[kDirections];
  for (std::size_t i = 0; i < kDirections; ++i) {
    const double* const v = vectors_.data() + i * K;
    double change = 0;
    length2[i] = 0;
    for (int a = 0; a < K; ++a) {
      change += slope[a] * v[a];
      length2[i] += v[a] * v[a];
    }
    step[i] = share * std::clamp(steepest * (1 + change), kLeastStep, 1.0);
    for (int a = 0; a < K; ++a) place[a][i] = step[i] * v[a];
    nearest2[i] = INFINITY;
  }
  // Tests all places in one loop, which vectorises: stopping at the first that takes a place costs
  // more.
  for (const double* at = begin; at != end; at += K + 2)
    for (std::size_t i = 0; i < kDirections; ++i) {
      double distance2 = at[K];
      for (int a = 0; a < K; ++a) distance2 += (at[a] - place[a][i]) * (at[a] - place[a][i]);
      nearest2[i] = distance2 < nearest2[i] ? distance2 : nearest2[i];
    }
  for (std::uint32_t i = 0; i < kDirections; ++i) {
    const double apart = step[i] * (kKeep * spacing_);
    if (nearest2[i] < apart * apart) continue;
    const double clear = std::min(std::sqrt(nearest2[i]), far - step[i] * std::sqrt(length2[i]));
    free->push_back({names_.Neighbour(border_.name[p], i), border_.patch[p], p, i, step[i], clear});
  }
}

template <int K>
std::vector<typename Growth<K>::Proposal> Growth<K>::FreePlaces() const {
  const Runs runs = RunsOf(border_.points, border_.shares);
  const double reach = longest_ + (kKeep + Beside(is_graded_)) * spacing_;
  return ParallelGather<Proposal>(runs.count(), [&](std::size_t run, auto* free) {
    thread_local Placed near;
    GatherPlaced(runs, run, border_.shares, reach, &near);
    for (std::size_t p = runs.begin(run); p < runs.end(run); ++p)
      ProposeFrom(static_cast<std::uint32_t>(p), near, free);
  });
}

// Several points mostly propose the same place: their mean is queried, with the mean of their
// frames. Proposals that strain has torn apart are several places.
template <int K>
typename Growth<K>::Proposed Growth<K>::ByPlace(std::vector<Proposal> proposals) const {
  ParallelSort(proposals, [](const Proposal& a, const Proposal& b) {
    if (a.patch != b.patch) return a.patch < b.patch;
    return a.name != b.name ? a.name < b.name : a.parent < b.parent;
  });
  Numbers landed(proposals.size() * stride());
  ParallelFor(proposals.size(),
              [&](std::size_t i) { Land(proposals[i], landed.data() + i * stride()); });
  const auto apart = [&](std::size_t i, const double* point) {
    return Distance(landed.data() + i * stride(), point, d_);
  };
  const auto are_namesakes = [&](std::size_t i, std::size_t j) {
    return proposals[i].name == proposals[j].name && proposals[i].patch == proposals[j].patch;
  };
  std::vector<std::size_t> begins =
      ParallelGather<std::size_t>(proposals.size(), [&](std::size_t i, auto* found) {
        if (i > 0 && are_namesakes(i, i - 1)) return;  // found with the first of its name
        std::size_t begin = i;
        found->push_back(begin);
        while (++i < proposals.size() && are_namesakes(i, begin))
          if (apart(i, landed.data() + begin * stride()) >=
              kMerged * spacing_ * std::min(proposals[i].share, proposals[begin].share))
            found->push_back(begin = i);
      });
  Proposed places(begins.size(), stride(), predicts_);
  begins.push_back(proposals.size());
  ParallelFor(places.sites.size(), [&](std::size_t place) {
    const std::size_t begin = begins[place], end = begins[place + 1];
    double* const point = places.sites.points.data() + place * stride();
    double* const frame = places.sites.frames.data() + place * stride() * K;
    const double share = 1 / static_cast<double>(end - begin);
    places.sites.Clear(place, stride());
    places.clear[place] = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const double* const other = border_.frames.data() + proposals[i].parent * stride() * K;
      for (std::size_t j = 0; j < stride(); ++j) point[j] += share * landed[i * stride() + j];
      for (std::size_t j = 0; j < stride() * K; ++j) frame[j] += share * other[j];
      const double* const change = border_.changes.data() + proposals[i].parent * change_stride();
      for (std::size_t j = 0; j < change_stride(); ++j)
        places.sites.changes[place * change_stride() + j] += share * change[j];
      places.sites.shares[place] += share * proposals[i].share;
    }
    for (std::size_t i = begin; i < end; ++i)
      places.clear[place] = std::max(places.clear[place], proposals[i].clear - apart(i, point));
    places.sites.patch[place] = proposals[begin].patch;
    places.sites.name[place] = proposals[begin].name;
    places.parents[place] = static_cast<std::uint16_t>(end - begin);
    places.first[place] = proposals[begin].parent;
  });
  return places;
}

// Merges places of one patch that coincide although their names differ. If two patches meet, only
// one of them proposes. Of a part's places, what others lead is theirs.
template <int K>
typename Growth<K>::Proposed Growth<K>::Merge(Proposed places, const Borders& borders) const {
  const Sites& sites = places.sites;
  const NearLists near(sites.points, d_, kMerged * spacing_, sites.shares);
  const std::vector<std::uint8_t> leads = ChooseLocalMaxima(
      territory_.peers(), borders, sites.size(), [&](std::size_t i, const auto& visit) {
        for (const std::uint32_t j : near.Of(i))
          if (j > i || !visit(j)) return;
      });
  const auto distance2 = [&](std::size_t i, std::size_t j) {
    return SquaredDistance(sites.points.data() + i * stride(), sites.points.data() + j * stride(),
                           d_);
  };
  UnsetVector<std::uint32_t> leader(sites.size());
  ParallelFor(sites.size(), [&](std::size_t i) {
    leader[i] = static_cast<std::uint32_t>(i);
    if (leads[i]) return;
    double nearest2 = INFINITY;
    for (const std::uint32_t j : near.Of(i)) {
      if (!leads[j] || !(distance2(i, j) < nearest2)) continue;
      nearest2 = distance2(i, j);
      leader[i] = j;
    }
  });
  const std::vector<std::uint32_t> leaders = ParallelSelect(sites.size(), [&](std::size_t i) {
    return leads[i] &&
           (territory_.is_whole() || territory_.Owns(sites.points.data() + i * stride()));
  });
  if (leaders.size() == sites.size()) return places;
  Proposed merged(leaders.size(), stride(), predicts_);
  ParallelFor(leaders.size(), [&](std::size_t l) {
    const std::uint32_t lead = leaders[l];
    const auto is_of = [&](std::uint32_t i) {
      return leader[i] == lead && sites.patch[i] == sites.patch[lead];
    };
    double* const point = merged.sites.points.data() + l * stride();
    double* const frame = merged.sites.frames.data() + l * stride() * K;
    merged.sites.Clear(l, stride());
    merged.parents[l] = 0;
    double count = places.parents[lead];
    for (const std::uint32_t i : near.Of(lead)) count += is_of(i) ? places.parents[i] : 0;
    const auto add = [&](std::uint32_t i) {
      const double weight = places.parents[i] / count;
      const double* const from = sites.points.data() + i * stride();
      const double* const other = sites.frames.data() + i * stride() * K;
      for (std::size_t j = 0; j < stride(); ++j) point[j] += weight * from[j];
      for (std::size_t j = 0; j < stride() * K; ++j) frame[j] += weight * other[j];
      const double* const change = sites.changes.data() + i * change_stride();
      for (std::size_t j = 0; j < change_stride(); ++j)
        merged.sites.changes[l * change_stride() + j] += weight * change[j];
      merged.sites.shares[l] += weight * sites.shares[i];
      merged.parents[l] += places.parents[i];
    };
    add(lead);
    for (const std::uint32_t i : near.Of(lead))
      if (is_of(i)) add(i);
    merged.sites.patch[l] = sites.patch[lead];
    merged.sites.name[l] = sites.name[lead];
    merged.first[l] = places.first[lead];
    merged.clear[l] =
        places.clear[lead] - Distance(point, sites.points.data() + lead * stride(), d_);
  });
  return merged;
}

#define STELLATE_EACH(K)                                                                     \
  template void Growth<K>::Land(const Proposal&, double*) const;                             \
  template void Growth<K>::ProposeFrom(std::uint32_t, const Placed&, std::vector<Proposal>*) \
      const;                                                                                 \
  template std::vector<Growth<K>::Proposal> Growth<K>::FreePlaces() const;                   \
  template Growth<K>::Proposed Growth<K>::ByPlace(std::vector<Proposal>) const;              \
  template Growth<K>::Proposed Growth<K>::Merge(Proposed, const Borders&) const;
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
