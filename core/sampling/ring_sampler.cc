#include "core/sampling/ring_sampler.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "core/base/power.h"

namespace stellate::core {
namespace {

void Append(const AnsweredPoints& from, const std::vector<Eigen::Index>& columns,
            AnsweredPoints* to) {
  const auto append = [&](const Eigen::MatrixXd& source, Eigen::MatrixXd* target) {
    const Eigen::Index before = target->cols();
    target->conservativeResize(source.rows(), before + std::ssize(columns));
    for (std::size_t i = 0; i < columns.size(); ++i)
      target->col(before + static_cast<Eigen::Index>(i)) = source.col(columns[i]);
  };
  append(from.points, &to->points);
  append(from.tangents, &to->tangents);
  to->found.resize(to->found.size() + columns.size(), 1);
  if (from.sizes.size() == 0) return;
  const Eigen::Index before = to->sizes.size();
  to->sizes.conservativeResize(before + std::ssize(columns));
  for (std::size_t i = 0; i < columns.size(); ++i)
    to->sizes[before + static_cast<Eigen::Index>(i)] = from.sizes[columns[i]];
}

}  // namespace

template <int K>
RingSampler<K>::RingSampler(Engine<K>& engine, const Specification& spec, double apart)
    : engine_(engine),
      are_drawn_(spec.seeds.cols() == 0),
      predicts_(!spec.oracle.tangent_basis),
      apart_(apart),
      growth_(engine.stars().sample().d(), SampleSpacing(K, engine.criteria().epsilon), predicts_,
              engine.stars().peers()),
      scouting_(std::make_unique<SharedGrowth<K>>(engine.stars().sample().d(),
                                                  apart_ * growth_.spacing(), predicts_,
                                                  engine.stars().peers())) {
  if (engine.boundary().policy().MeshesFacesFirst()) clearance_.emplace(engine, growth_.spacing());
}

template <int K>
std::vector<std::uint8_t> RingSampler<K>::Begin(const AnsweredPoints& seeds) {
  seeds_ = seeds;
  if (clearance_) seeds_.found = clearance_->AreClear(seeds.points, seeds.found);
  return Scout(seeds, scouting_->Begin(seeds.points, seeds.tangents, seeds_.found,
                                       scouting_->spacing(), SharesOf(engine_.sizes(), seeds)));
}

template <int K>
void RingSampler<K>::GoOn(const AnsweredPoints& sample, const AnsweredPoints& seeds) {
  seeds_ = seeds;
  scouting_.reset();
  growth_.Begin(sample.points, sample.tangents, sample.found, 0);
}

// The scouts' points join the sample immediately: they are the mesh if the run ends here.
template <int K>
std::vector<std::uint8_t> RingSampler<K>::Scout(const AnsweredPoints& answers,
                                                const std::vector<Eigen::Index>& columns) {
  Append(answers, columns, &scouts_);
  return AddToSample<K>(engine_, answers, columns);
}

// Where many parts make one mesh, the scouts say how to cut it into boxes of as much to do.
template <int K>
void RingSampler<K>::GrowFromScouts() {
  const Eigen::VectorXd shares = SharesOf(engine_.sizes(), scouts_);
  if (!predicts_ && shares.size() == 0)
    growth_.CutUp({{scouts_.points.data(), static_cast<std::size_t>(scouts_.points.size())},
                   engine_.stars().sample().d(),
                   engine_.stars().peers().parts()});
  growth_.Begin(scouts_.points, scouts_.tangents, scouts_.found, 0, shares);
}

template <int K>
typename Growth<K>::Ring RingSampler<K>::NextRing() {
  typename Growth<K>::Ring ring;
  if (engine_.is_full()) return ring;
  if (scouting_ && (scouting_->size() > 1 || !are_drawn_)) ring = scouting_->Propose();
  if (scouting_ && ring.points.cols() == 0) {
    scouting_.reset();
    GrowFromScouts();
  }
  if (!scouting_) {
    ring = growth_.Propose();
    if (ring.points.cols() == 0) {
      // Parts that no patch came near have seeds of their own.
      AddToSample<K>(engine_, seeds_,
                     growth_.Begin(seeds_.points, seeds_.tangents, seeds_.found,
                                   apart_ * growth_.spacing(), SharesOf(engine_.sizes(), seeds_)));
      if (!engine_.is_full()) ring = growth_.Propose();
    }
  }
  return ring;
}

// Returns the clear points of a ring or, if it has none, of the next.
template <int K>
CandidateSet<K> RingSampler<K>::Next(std::uint64_t) {
  CandidateSet<K> candidates;
  while (true) {
    typename Growth<K>::Ring ring = NextRing();
    proposed_ = ring.points.cols();
    if (proposed_ == 0) {  // the sample is complete: what follows needs the memory
      growth_.Forget();
      seeds_ = scouts_ = {};
      return candidates;
    }
    std::vector<std::uint8_t> all(static_cast<std::size_t>(proposed_), 1);
    const std::vector<std::uint8_t> is_clear =
        clearance_ ? clearance_->AreClear(ring.points, all) : all;
    asked_.clear();
    for (Eigen::Index c = 0; c < proposed_; ++c)
      if (is_clear[static_cast<std::size_t>(c)]) asked_.push_back(c);
    if (asked_.empty()) {
      growing().Join(ring.points, ring.tangents, is_clear);
      continue;
    }
    if (std::ssize(asked_) == proposed_) {
      candidates.planned.points = std::move(ring.points);
      candidates.planned.tangents = std::move(ring.tangents);
      candidates.planned.bends = std::move(ring.bends);
      candidates.planned.spacing = std::move(ring.spacing);
    } else {
      candidates.planned.points = ring.points(Eigen::all, asked_);
      candidates.planned.tangents = ring.tangents(Eigen::all, asked_);
    }
    return candidates;
  }
}

// Returns the answers for the whole ring, found where they are clear. An answer beyond a wall that
// no vertex near is on discovers that wall.
template <int K>
AnsweredPoints RingSampler<K>::KeepClear(const AnsweredPoints& answers) {
  std::vector<std::uint8_t> fits = clearance_->AreClear(answers.points, answers.found);
  AnsweredPoints ring;
  ring.points.setZero(answers.points.rows(), proposed_);
  ring.tangents.setZero(answers.tangents.rows(), proposed_);
  ring.found.assign(static_cast<std::size_t>(proposed_), 0);
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    const auto c = static_cast<Eigen::Index>(i);
    if (!fits[i]) continue;
    if (const std::optional<int> beyond = answers.Beyond(c)) {
      if (!clearance_->KnowsWallNear(answers.points.col(c).data(), growing().reach()))
        engine_.boundary().Discover(answers.points.col(c), 0, *beyond);
      continue;
    }
    ring.points.col(asked_[i]) = answers.points.col(c);
    ring.tangents.col(asked_[i]) = answers.tangents.col(c);
    ring.found[static_cast<std::size_t>(asked_[i])] = 1;
  }
  return ring;
}

template <int K>
std::vector<std::uint8_t> RingSampler<K>::Take(const CandidateSet<K>&,
                                               const AnsweredPoints& answers) {
  std::vector<Eigen::Index> joined;
  if (clearance_) {
    const AnsweredPoints ring = KeepClear(answers);
    joined = growing().Join(ring.points, ring.tangents, ring.found);
    for (Eigen::Index& c : joined)
      c = std::lower_bound(asked_.begin(), asked_.end(), c) - asked_.begin();
  } else {
    joined = growing().Join(answers.points, answers.tangents, answers.found,
                            SharesOf(engine_.sizes(), answers));
  }
  return scouting_ ? Scout(answers, joined) : AddToSample<K>(engine_, answers, joined);
}

template <int K>
double RingSampler<K>::CountMissing() const {
  const double here = 2.0 * static_cast<double>(growth_.border());
  return scouting_ ? here + Power(apart_, K) * static_cast<double>(scouting_->size()) : here;
}

STELLATE_INSTANTIATE_CLASS(RingSampler)

}  // namespace stellate::core
