// How a run begins: its seeds, and the sample that is laid from them.

#include <algorithm>
#include <utility>

#include "core/refinement/exchange.h"
#include "core/run/meshing_run.h"
#include "core/run/seeding.h"

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
  laying_ = LayingFor<K>(engine_, spec_, answers);
  if (laying_) {
    used = laying_->Begin(answers);
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
void MeshingRun<K>::LayAnswered() {
  const std::vector<std::uint8_t> used = laying_->Take(trip_->candidates(), trip_->answers());
  report_.counts.inserted_size +=
      static_cast<std::uint64_t>(std::count(used.begin(), used.end(), 1));
  spare_points_.Keep(trip_->answers(), used);
}

// Whether the sample is not yet laid. What goes on without end is left to Plan.
template <int K>
bool MeshingRun<K>::AskToLay() {
  if (!laying_) return false;
  box_watch_.Look(engine_.stars().sample().points().data(), engine_.stars().size());
  CandidateSet<K> candidates;
  if (!box_watch_.has_left()) candidates = laying_->Next(whole_rounds_);
  if (candidates.size() == 0) {
    laid_ = std::move(laying_);
    was_laid_ = true;
    return false;
  }
  Ask(std::move(candidates), &MeshingRun::LayAnswered, laying_->asking());
  return true;
}

// Besides what else the round has changed.
template <int K>
void MeshingRun<K>::CommitLaid() {
  const std::vector<std::uint32_t> before = engine_.stars().Simplices();
  if (before.empty() && delta_.removed.empty()) {
    delta_.added = engine_.Commit().added;
    return;
  }
  engine_.Commit();
  ExchangeSimplices<K>(before, engine_.stars().Simplices(), &delta_.added, &delta_.removed);
}

#define STELLATE_EACH(K)                      \
  template void MeshingRun<K>::CommitLaid();  \
  template void MeshingRun<K>::InsertSeeds(); \
  template void MeshingRun<K>::LayAnswered(); \
  template bool MeshingRun<K>::AskToLay();
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
