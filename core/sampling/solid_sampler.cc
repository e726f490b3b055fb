#include "core/sampling/solid_sampler.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/base/parallel.h"

namespace stellate::core {
namespace {

// Proposals nearer to each other than this many spacings are one place of the lattice.
constexpr double kSamePlace = 0.5;
// Points that join without a query between them; later as many as there are. What is unbounded
// would otherwise be sampled in one round, up to the limit of vertices, before the run sees that it
// leaves its box, and the server how much memory it takes.
constexpr std::uint32_t kFewAtOnce = 1u << 14;

// The lattice is not rotated anywhere.
template <int K>
Eigen::MatrixXd FramesFor(Eigen::Index count) {
  const Eigen::Matrix<double, K, K> frame = Eigen::Matrix<double, K, K>::Identity();
  return frame.reshaped().replicate(1, count);
}

}  // namespace

template <int K>
SolidSampler<K>::SolidSampler(Engine<K>& engine)
    : engine_(engine),
      growth_(K, SampleSpacing(K, engine.criteria().epsilon)),
      clearance_(engine, growth_.spacing()),
      doubts_(K, &doubted_) {}

template <int K>
std::vector<std::uint8_t> SolidSampler<K>::Begin(const AnsweredPoints& seeds) {
  seeds_ = seeds;
  seeds_.found = clearance_.AreClear(seeds.points, seeds.found);
  return std::vector<std::uint8_t>(seeds.found.size(), 0);
}

// Each part of the domain that the lattice has not reached gets a lattice of its own.
template <int K>
bool SolidSampler<K>::BeginFromNextSeed() {
  const std::vector<Eigen::Index> begun =
      growth_.Begin(seeds_.points, FramesFor<K>(seeds_.points.cols()), seeds_.found, INFINITY);
  AddToSample<K>(engine_, seeds_, begun);
  return !begun.empty();
}

// Returns whether it will be queried, and was not before.
template <int K>
bool SolidSampler<K>::Doubt(const double* point) {
  if (doubts_.AnyWithin(point, kSamePlace * growth_.spacing())) return false;
  doubted_.insert(doubted_.end(), point, point + K);
  doubts_.Insert(0);
  return true;
}

// Grows as far as all points are certainly inside, or until there are so many that it queries one
// of them and waits.
template <int K>
void SolidSampler<K>::Grow() {
  const std::uint32_t before = engine_.stars().size();
  const std::uint32_t most = before + std::max(before, kFewAtOnce);
  while (!engine_.is_full()) {
    const std::uint32_t size = engine_.stars().size();
    if (size >= most && Doubt(engine_.stars().sample().Point(size - 1))) return;
    typename Growth<K>::Ring ring = growth_.Propose();
    const Eigen::Index count = ring.points.cols();
    if (count == 0) return;
    std::vector<std::uint8_t> inside(static_cast<std::size_t>(count)), doubtful(inside.size());
    ParallelFor(inside.size(), [&](std::size_t i) {
      const double* const point = ring.points.col(static_cast<Eigen::Index>(i)).data();
      inside[i] = clearance_.IsSurelyInside(point, growth_.reach());
      doubtful[i] = !inside[i] && clearance_.IsClear(point);
    });
    for (Eigen::Index c = 0; c < count; ++c)
      if (doubtful[static_cast<std::size_t>(c)]) Doubt(ring.points.col(c).data());
    AnsweredPoints own;
    own.points = std::move(ring.points);
    own.tangents = FramesFor<K>(count);
    AddToSample<K>(engine_, own, growth_.Join(own.points, own.tangents, inside));
  }
}

template <int K>
CandidateSet<K> SolidSampler<K>::Next(std::uint64_t) {
  do Grow();
  while (doubts_.size() == asked_ && !engine_.is_full() && BeginFromNextSeed());
  CandidateSet<K> candidates;
  if (engine_.is_full()) return candidates;
  candidates.planned.points = Eigen::Map<const Eigen::MatrixXd>(
      doubted_.data() + asked_ * K, K, static_cast<Eigen::Index>(doubts_.size() - asked_));
  asked_ = doubts_.size();
  return candidates;
}

template <int K>
std::vector<std::uint8_t> SolidSampler<K>::Take(const CandidateSet<K>&,
                                                const AnsweredPoints& answers) {
  std::vector<std::uint8_t> inside = clearance_.AreClear(answers.points, answers.found);
  for (std::size_t i = 0; i < inside.size(); ++i)
    inside[i] = inside[i] && !answers.Beyond(static_cast<Eigen::Index>(i));
  const double apart = Growth<K>::kKeep * growth_.spacing();
  return AddToSample<K>(engine_, answers,
                        growth_.Begin(answers.points, FramesFor<K>(answers.points.cols()), inside,
                                      apart, {}, Growth<K>::kKeep));
}

STELLATE_INSTANTIATE_CLASS(SolidSampler)

}  // namespace stellate::core
