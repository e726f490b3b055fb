// The engine's work for manifolds with boundary: faces are meshed by dimension, the lowest first.

#include <algorithm>
#include <utility>
#include <vector>

#include "core/refinement/engine.h"
#include "core/refinement/exchange.h"
#include "core/refinement/face_splits.h"
#include "core/refinement/protecting_balls.h"

namespace stellate::core {

template <int K>
bool Engine<K>::AdvanceStage() {
  if (!boundary_.Advance()) return false;
  if (boundary_.stage() == K) stars_.IncludeInterior();
  RejudgeAll();
  MarkAllDirty();
  violations_.ForgetAttempts();
  return true;
}

template <int K>
bool Engine<K>::LeaveStage() {
  if (boundary_.is_last_stage()) return false;
  boundary_.Leave();
  return AdvanceStage();
}

// In boundary-only mode stars are built only as far as the boundary is known.
template <int K>
void Engine<K>::CompleteStars(std::vector<std::uint32_t>* added,
                              std::vector<std::uint32_t>* removed) {
  if (boundary_.stage() == K || boundary_.policy().LeavesInside() || stars_.size() == 0) return;
  const std::vector<std::uint32_t> before = stars_.Simplices();
  stars_.IncludeInterior();
  stars_.Commit();
  ExchangeSimplices<K>(before, stars_.Simplices(), added, removed);
}

template <int K>
bool Engine<K>::NeedsProtectingBalls(const std::vector<Target<K>>& targets) const {
  return K == 3 && boundary_.stage() >= 1 && !boundary_.has_discoveries() &&
         std::all_of(targets.begin(), targets.end(),
                     [](const Target<K>& t) { return t.violation.dimension() >= 2; }) &&
         NeedsProtection<K>(stars_);
}

template <int K>
std::optional<std::vector<Target<K>>> Engine<K>::ProtectSharpEdges(
    std::vector<std::uint32_t>* added, std::vector<std::uint32_t>* removed) {
  ProtectingBalls<K> balls = PlanProtectingBalls<K>(stars_, sizes_);
  if (boundary_.MaySplitForBalls(stars_.size(), MostSplits<K>(balls))) {
    const FaceSplits<K> face_splits(parts());
    std::vector<Target<K>> splits;
    for (const auto& gap : balls.gaps)
      if (!violations_.is_given_up(gap.star))
        if (const auto split = face_splits.Of(gap, Rule::kSize)) splits.push_back(*split);
    if (!splits.empty()) return splits;
  }
  boundary_.NoteProtected();
  const std::vector<std::uint32_t> before = stars_.Simplices();
  stars_.SetProtectingBalls(std::move(balls.radii2));
  ExchangeSimplices<K>(before, stars_.Simplices(), added, removed);
  RejudgeAll();
  MarkAllDirty();
  violations_.ForgetAttempts();
  return Plan();
}

#define STELLATE_EACH(K)                                                              \
  template bool Engine<K>::AdvanceStage();                                            \
  template bool Engine<K>::LeaveStage();                                              \
  template void Engine<K>::CompleteStars(std::vector<std::uint32_t>*,                 \
                                         std::vector<std::uint32_t>*);                \
  template bool Engine<K>::NeedsProtectingBalls(const std::vector<Target<K>>&) const; \
  template std::optional<std::vector<Target<K>>> Engine<K>::ProtectSharpEdges(        \
      std::vector<std::uint32_t>*, std::vector<std::uint32_t>*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
