// How a run finds out that M is not smooth: by queries in addition to its own, and before it gives
// up.

#include <utility>

#include "core/base/message.h"
#include "core/certificate/findings.h"
#include "core/run/ending.h"
#include "core/run/meshing_run.h"

namespace stellate::core {
namespace {

constexpr double kLongestWay = 2;  // of epsilon
// In epsilon. A front has edges so short, along which tangent spaces turn by 30 degrees, only at
// creases, or where M bends far more sharply than the mesh is fine.
constexpr double kTellingWay = 0.5, kTellingSine2 = 0.25;

}  // namespace

// Probes steep edges once rules have kept failing for a while.
template <int K>
void MeshingRun<K>::WatchForCreases() {
  const ViolationIndex<K>& violations = engine_.violations();
  const bool due = crease_watch_.IsDue(violations.size_and_shape().size() + violations.violating(),
                                       !violations.are_all_dirty());
  if (crease_probe_.is_asking() || K == spec_.ambient_dimension) return;
  if (due)
    crease_probe_.Start(
        SteepWaysAtFaults<K>(engine_, kLongestWay * spec_.epsilon, kLeastSine2, &walked_));
  else if (crease_watch_.MayLookAgain())
    crease_probe_.Start(
        SteepWaysAtFaults<K>(engine_, kTellingWay * spec_.epsilon, kTellingSine2, &walked_));
}

template <int K>
void MeshingRun<K>::AskBeside() {
  probe_block_.reset();
  if (end_ || (trip_ && crease_probe_.is_asking())) {
    if (!end_) batch_->blocks.push_back(std::move(crease_probe_.Questions().front()));
    probe_block_ = batch_->blocks.size() - 1;
  }
  if (repeat_check_.has_questions()) batch_->blocks.push_back(repeat_check_.Questions());
}

template <int K>
void MeshingRun<K>::TakeBeside(const Answers& answers) {
  if (!probe_block_) return;
  crease_probe_.Absorb({answers.blocks[*probe_block_]});
  probe_block_.reset();
  if (crease_probe_.crease()) Finish(end_.value_or(Termination::kNoProgress));
}

// Ends the run, once it is known whether a crease keeps it from a better end.
template <int K>
void MeshingRun<K>::End(Termination termination) {
  const bool may_be_creased = K < spec_.ambient_dimension && !box_watch_.has_left();
  if (may_be_creased && !crease_probe_.is_asking()) {
    const double longest = kLongestWay * spec_.epsilon;
    if (termination == Termination::kNoProgress)
      crease_probe_.Start(SteepWaysAtFaults<K>(engine_, longest));
    else if (certification_ && certification_->certificate().epsilon_over_reach > kCoarse)
      crease_probe_.Start(SteepWays<K>(engine_.stars(), longest));
  }
  if (!may_be_creased || !crease_probe_.is_asking()) return Finish(termination);
  end_ = termination;
}

#define STELLATE_EACH(K)                                   \
  template void MeshingRun<K>::WatchForCreases();          \
  template void MeshingRun<K>::AskBeside();                \
  template void MeshingRun<K>::TakeBeside(const Answers&); \
  template void MeshingRun<K>::End(Termination);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
