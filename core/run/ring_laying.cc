#include "core/run/ring_laying.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/interruption.h"

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
}

}  // namespace

template <int K>
RingLaying<K>::RingLaying(Engine<K>& engine)
    : engine_(engine),
      growth_(engine.complex().d(), LaidSpacing(K, engine.criteria().epsilon)),
      scouting_(
          std::make_unique<Growth<K>>(engine.complex().d(), kPatchesApart * growth_.spacing())) {}

template <int K>
std::vector<std::uint8_t> RingLaying<K>::Begin(const AnsweredPoints& seeds) {
  seeds_ = seeds;
  return Scout(seeds,
               scouting_->Begin(seeds.points, seeds.tangents, seeds.found, scouting_->spacing()));
}

template <int K>
std::vector<std::uint8_t> RingLaying<K>::Lay(const AnsweredPoints& answers,
                                             const std::vector<Eigen::Index>& columns) {
  std::vector<std::uint8_t> used(answers.found.size(), 0);
  for (const Eigen::Index c : columns) {
    CheckInterruption(static_cast<std::size_t>(c));
    if (engine_.is_full()) break;
    engine_.Lay(answers, c);
    used[static_cast<std::size_t>(c)] = 1;
  }
  return used;
}

// What scouts find is of the sample at once: it is what there is if the run ends here.
template <int K>
std::vector<std::uint8_t> RingLaying<K>::Scout(const AnsweredPoints& answers,
                                               const std::vector<Eigen::Index>& columns) {
  Append(answers, columns, &scouts_);
  return Lay(answers, columns);
}

template <int K>
CandidateSet<K> RingLaying<K>::Next(std::uint64_t) {
  typename Growth<K>::Ring ring;
  // Where all is within reach of one seed there is nothing to scout.
  if (scouting_ && scouting_->size() > 1) ring = scouting_->Propose();
  if (scouting_ && ring.points.cols() == 0) {
    scouting_.reset();
    growth_.Begin(scouts_.points, scouts_.tangents, scouts_.found, 0);
  }
  if (!scouting_ && !engine_.is_full()) {
    ring = growth_.Propose();
    if (ring.points.cols() == 0) {
      // What no patch came near has seeds of its own.
      Lay(seeds_, growth_.Begin(seeds_.points, seeds_.tangents, seeds_.found,
                                kPatchesApart * growth_.spacing()));
      if (!engine_.is_full()) ring = growth_.Propose();
    }
  }
  CandidateSet<K> candidates;
  candidates.planned.points = std::move(ring.points);
  candidates.planned.tangents = std::move(ring.tangents);
  return candidates;
}

template <int K>
std::vector<std::uint8_t> RingLaying<K>::Take(const CandidateSet<K>&,
                                              const AnsweredPoints& answers) {
  Growth<K>& growth = scouting_ ? *scouting_ : growth_;
  const std::vector<Eigen::Index> joined =
      growth.Join(answers.points, answers.tangents, answers.found);
  return scouting_ ? Scout(answers, joined) : Lay(answers, joined);
}

template <int K>
double RingLaying<K>::CountMissing() const {
  const double here = 2.0 * static_cast<double>(growth_.border());
  return scouting_ ? here + std::pow(kPatchesApart, K) * static_cast<double>(scouting_->size())
                   : here;
}

STELLATE_INSTANTIATE_CLASS(RingLaying)

}  // namespace stellate::core
