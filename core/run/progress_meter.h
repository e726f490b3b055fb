#pragma once

#include "core/refinement/engine.h"
#include "core/report.h"

namespace stellate::core {

// Brings the counts, the phase and the fraction of a run up to date with its mesh; rounds and
// queries are the caller's. is_certifying: every rule holds, and the certificate asks. to_lay:
// about how many points are to come before there are stars.
template <int K>
void Measure(const Engine<K>& engine, bool is_certifying, double to_lay, Progress* progress);

}  // namespace stellate::core
