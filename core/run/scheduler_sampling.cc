// How a run begins: its seeds, and the initial sample.

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "core/refinement/exchange.h"
#include "core/run/scheduler.h"
#include "core/sampling/seeding.h"

namespace stellate::core {
namespace {

// Makes the sample again, before there is any star, with tangent spaces that all of it improved.
template <int K>
void RefineTangents(const Specification& spec, TangentFinder& finder, Engine<K>* engine) {
  const Sample<K>& sample = engine->stars().sample();
  const Eigen::Index count = sample.size();
  if (count == 0 || engine->violations().star_count() > 0) return;
  AnsweredPoints sampled;
  sampled.points = Eigen::Map<const Eigen::MatrixXd>(sample.points().data(), sample.d(), count);
  sampled.tangents = Eigen::Map<const Eigen::MatrixXd>(sample.Tangent(0), sample.d() * K, count);
  if (const double* sizes = engine->sizes().given())
    sampled.sizes = Eigen::Map<const Eigen::VectorXd>(sizes, count);
  const Eigen::MatrixXd before = sampled.tangents;
  const Peers& peers = engine->stars().peers();
  finder.Refine(sampled.points, &sampled.tangents);
  if (sampled.tangents == before) return;
  // Others refer to the engine by its address.
  std::destroy_at(engine);
  std::construct_at(engine, spec, Resolve(spec), peers);
  for (Eigen::Index c = 0; c < count; ++c) engine->AddToSample(sampled, c);
}

}  // namespace

template <int K>
void Scheduler<K>::InsertSeeds() {
  const AnsweredPoints& answers = source_.trip()->answers();
  const Eigen::Index count = answers.points.cols();
  const auto found = std::count(answers.found.begin(), answers.found.end(), 1);
  noticed_.covers_box = spec_.cover_box && found == count;
  if (found == 0) return Fail({StatusCode::kNoSeeds, WhyNoSeeds(spec_, answers)});
  checks_.repeat.Sample(answers);
  std::vector<std::uint8_t> used(static_cast<std::size_t>(count), 0);
  if (sample_.Begin(engine_, spec_, answers, &used)) {
    counts_.meter.Know(answers, used);
    return spare_points_.Keep(answers, used);
  }
  for (Eigen::Index c = 0; c < count; ++c) {
    const auto i = static_cast<std::size_t>(c);
    CheckInterruption(i);
    if (!answers.found[i]) continue;
    used[i] = !engine_.is_full() && !engine_.stars().sample().AnyWithin(
                                        answers.points.col(c).data(), engine_.criteria().epsilon);
    if (used[i])
      engine_.Append(answers, c);
    else
      ++counts_.counts.duplicates;
  }
  counts_.meter.Know(answers, used);
  spare_points_.Keep(answers, used);
}

template <int K>
void Scheduler<K>::AddAnswered() {
  const std::vector<std::uint8_t> used =
      sample_.Take(source_.trip()->candidates(), source_.trip()->answers());
  counts_.counts.inserted_size +=
      static_cast<std::uint64_t>(std::count(used.begin(), used.end(), 1));
  spare_points_.Keep(source_.trip()->answers(), used);
}

// Returns whether the initial sample is still incomplete, and queries more of it. Plan ends a
// sample that has no end.
template <int K>
bool Scheduler<K>::AskForSample() {
  if (!sample_.is_growing()) return false;
  noticed_.box.Look(engine_.stars().sample().points().data(), engine_.stars().size());
  CandidateSet<K> candidates;
  if (!noticed_.box.has_left()) candidates = sample_.Next(counts_.answered);
  if (candidates.size() == 0) {
    sample_.Complete();
    if (!spec_.oracle.tangent_basis) RefineTangents<K>(spec_, source_.finder(), &engine_);
    return false;
  }
  source_.Ask(sample_.asking(), std::move(candidates), Purpose::kSample);
  return true;
}

// In addition to the other changes of the round.
template <int K>
void Scheduler<K>::CommitSample() {
  const std::vector<std::uint32_t> before = engine_.stars().Simplices();
  if (before.empty() && change_.removed.empty()) {
    change_.added = engine_.Commit().added;
    return;
  }
  engine_.Commit();
  ExchangeSimplices<K>(before, engine_.stars().Simplices(), &change_.added, &change_.removed);
}

#define STELLATE_EACH(K)                      \
  template void Scheduler<K>::CommitSample(); \
  template void Scheduler<K>::InsertSeeds();  \
  template void Scheduler<K>::AddAnswered();  \
  template bool Scheduler<K>::AskForSample();
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
