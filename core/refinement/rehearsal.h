#pragma once

#include <cstdint>
#include <vector>

#include "core/refinement/engine.h"
#include "core/refinement/surrogate.h"

namespace stellate::core {

// Asking ahead: drives a copy of the engine by guesses (core/refinement/surrogate.h) until it needs
// no more or they tell no more, and returns all points that it inserted, in that order. Targets
// that one of them mends are taken out of `targets`. Only the rules, checked on true points, decide
// when a run is over.
//
// round: whatever Draw would be given next.
// known: what is guessed already, of the manifold's whole; or null: from the engine's own sample.
enum class Rehearsed { kAllRules, kSizes };  // kSizes: R1 and R2 alone
template <int K>
PlannedPoints Rehearse(const Engine<K>& engine, std::uint64_t round,
                       std::vector<Target<K>>* targets, Rehearsed rules = Rehearsed::kAllRules,
                       Surrogate<K>* known = nullptr);

}  // namespace stellate::core
