// How a run begins: its seeds, and the initial sample.

#include <algorithm>
#include <utility>

#include "core/refinement/exchange.h"
#include "core/run/meshing_run.h"
#include "core/run/sampler_choice.h"
#include "core/sampling/seeding.h"

namespace stellate::core {

template <int K>
void MeshingRun<K>::InsertSeeds() {
  const AnsweredPoints& answers = trip_->answers();
  const Eigen::Index count = answers.points.cols();
  const auto found = std::count(answers.found.begin(), answers.found.end(), 1);
  covers_box_ = spec_.cover_box && found == count;
  if (found == 0) return Fail({StatusCode::kNoSeeds, WhyNoSeeds(spec_, count)});
  repeat_check_.Sample(answers);
  std::vector<std::uint8_t> used(static_cast<std::size_t>(count), 0);
  sampler_ = SamplerFor<K>(engine_, spec_, answers);
  if (sampler_) {
    used = sampler_->Begin(answers);
    progress_meter_.Know(answers, used);
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
      ++report_.counts.duplicates;
  }
  progress_meter_.Know(answers, used);
  spare_points_.Keep(answers, used);
}

template <int K>
void MeshingRun<K>::AddAnswered() {
  const std::vector<std::uint8_t> used = sampler_->Take(trip_->candidates(), trip_->answers());
  report_.counts.inserted_size +=
      static_cast<std::uint64_t>(std::count(used.begin(), used.end(), 1));
  spare_points_.Keep(trip_->answers(), used);
}

// Returns whether the initial sample is still incomplete, and queries more of it. Plan ends a
// sample that has no end.
template <int K>
bool MeshingRun<K>::AskForSample() {
  if (!sampler_) return false;
  box_watch_.Look(engine_.stars().sample().points().data(), engine_.stars().size());
  CandidateSet<K> candidates;
  if (!box_watch_.has_left()) candidates = sampler_->Next(whole_rounds_);
  if (candidates.size() == 0) {
    finished_sampler_ = std::move(sampler_);
    is_sampled_ = true;
    return false;
  }
  Ask(std::move(candidates), &MeshingRun::AddAnswered, sampler_->asking());
  return true;
}

// In addition to the other changes of the round.
template <int K>
void MeshingRun<K>::CommitSample() {
  const std::vector<std::uint32_t> before = engine_.stars().Simplices();
  if (before.empty() && delta_.removed.empty()) {
    delta_.added = engine_.Commit().added;
    return;
  }
  engine_.Commit();
  ExchangeSimplices<K>(before, engine_.stars().Simplices(), &delta_.added, &delta_.removed);
}

#define STELLATE_EACH(K)                       \
  template void MeshingRun<K>::CommitSample(); \
  template void MeshingRun<K>::InsertSeeds();  \
  template void MeshingRun<K>::AddAnswered();  \
  template bool MeshingRun<K>::AskForSample();
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
