#pragma once

#include <memory>

#include "core/sampling/sampler.h"

namespace stellate::core {

// Chooses the sampler of a run:
//
//   no walls,              | speculative, k < 4, sample not too large | SpeculativeSampler
//   sizes uniform or given | else                                     | RingSampler
//   walls, faces meshed,   | a domain of R^k                          | SolidSampler
//   k < 4, sizes uniform   | else, unless speculative                 | RingSampler
//
// Returns null in all other cases, if sizes are given and the run is speculative, and if the seeds
// found are dense (a sample themselves, or a large part of a coarse mesh): refinement alone then
// makes the sample. The engine must outlive the sampler; `spec` is the engine's.
template <int K>
std::unique_ptr<Sampler<K>> SamplerFor(Engine<K>& engine, const Specification& spec,
                                       const AnsweredPoints& seeds);

}  // namespace stellate::core
