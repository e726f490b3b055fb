#pragma once

#include <cstdint>
#include <vector>

#include "core/refinement/engine.h"

namespace stellate::core {

// Asking ahead: drives a copy of the engine by guesses (core/refinement/surrogate.h) until it needs
// no more or they tell no more, and returns all points that it inserted, in that order. Targets
// that one of them mends are taken out of `targets`. Only the rules, checked on true points, decide
// when a run is over.
//
// round: whatever Draw would be given next.
template <int K>
PlannedPoints Rehearse(const Engine<K>& engine, std::uint64_t round,
                       std::vector<Target<K>>* targets);

}  // namespace stellate::core
