// Where a lattice goes on.

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/growth/growth.h"

namespace stellate::core {
namespace {

// Of what is laid around a point, in its spacings squared: where less lies in a direction, sizes
// are taken to change little along it.
constexpr double kLeastMoment = 0.05;
// Simplices follow the smallest size of their corners: where sizes change, they are laid smaller
// by this share of the change in a spacing, at most by half.
constexpr double kSlopeMargin = 0.3;
constexpr double kLeastStep = 0.5;
// Places are looked at so many spacings farther around than what would take them lies: what is
// asked for there comes out a little beside, and mostly needs no search then. Slopes are told by
// what is near alone.
constexpr double Beside(bool is_graded) { return is_graded ? 0 : 0.15; }

// How shares change from that of a point, by its own coordinates, as least squares over what is
// laid around it tell: coordinates along its frame, the square of that across, and the share, each.
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
  return moments.ldlt().solve(changes);
}

}  // namespace

// Where a proposal lies: its parent's neighbour in the lattice, in the parent's tangent space.
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

// Compares in the parent's own coordinates. Towards smaller sizes it goes no farther than where it
// lands asks for.
template <int K>
void Growth<K>::ProposeFrom(std::uint32_t p, const Laid& near, std::vector<Proposal>* free) const {
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
  const std::size_t directions = vectors_.size() / K;
  for (std::uint32_t i = 0; i < directions; ++i) {
    const double* const v = vectors_.data() + std::size_t{i} * K;
    double change = 0, length2 = 0;
    for (int a = 0; a < K; ++a) {
      change += slope[a] * v[a];
      length2 += v[a] * v[a];
    }
    const double step = share * std::clamp(steepest * (1 + change), kLeastStep, 1.0);
    const double apart = step * (kKeep * spacing_);
    double nearest2 = INFINITY;
    for (const double* at = begin; at != end && nearest2 >= apart * apart; at += K + 2) {
      double distance2 = at[K];
      for (int a = 0; a < K; ++a) distance2 += (at[a] - step * v[a]) * (at[a] - step * v[a]);
      nearest2 = std::min(nearest2, distance2);
    }
    if (nearest2 >= apart * apart)
      free->push_back({p, i, step, std::min(std::sqrt(nearest2), far - step * std::sqrt(length2))});
  }
}

template <int K>
std::vector<typename Growth<K>::Proposal> Growth<K>::FreePlaces() const {
  const Runs runs = RunsOf(border_.points, border_.shares);
  return ParallelGather<Proposal>(runs.count(), [&](std::size_t run, auto* free) {
    thread_local Laid near;
    GatherLaid(runs, run, border_.shares, longest_ + (kKeep + Beside(is_graded_)) * spacing_, &near);
    for (std::size_t p = runs.begin(run); p < runs.end(run); ++p)
      ProposeFrom(static_cast<std::uint32_t>(p), near, free);
  });
}

#define STELLATE_EACH(K)                                                                          \
  template void Growth<K>::Land(const Proposal&, double*) const;                                  \
  template void Growth<K>::ProposeFrom(std::uint32_t, const Laid&, std::vector<Proposal>*) const; \
  template std::vector<Growth<K>::Proposal> Growth<K>::FreePlaces() const;
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
