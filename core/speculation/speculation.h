#pragma once

#include <cstdint>
#include <vector>

#include "core/refinement/engine.h"
#include "core/speculation/surrogate.h"

namespace stellate::core {

// Runs a copy of the engine on a surrogate of M (core/speculation/surrogate.h), until no rule is
// broken or the surrogate has no more answers, and returns the points that it inserted, in that
// order. Query them all in one batch. Removes the targets that one of them resolves from `targets`.
// Only the rules on true points decide when a run is over.
//
// round: as for the next Engine::Draw.
// known: a surrogate of the whole manifold, or null: make one from the engine's sample.
enum class SpeculativeRules { kAllRules, kSizes };  // kSizes: R1 and R2 alone
template <int K>
PlannedPoints RunSpeculatively(const Engine<K>& engine, std::uint64_t round,
                               std::vector<Target<K>>* targets,
                               SpeculativeRules rules = SpeculativeRules::kAllRules,
                               Surrogate<K>* known = nullptr);

}  // namespace stellate::core
