#pragma once

#include "core/refinement/engine.h"
#include "core/report.h"

namespace stellate::core {

// Brings the counts, the phase and the fraction of a run up to date with its mesh; rounds and
// queries are the caller's. is_certifying: every rule holds, and the certificate asks.
template <int K>
void Measure(const Engine<K>& engine, bool is_certifying, Progress* progress);

}  // namespace stellate::core
