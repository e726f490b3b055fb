#pragma once

#include <memory>

#include "core/sampling/sampler.h"

namespace stellate::core {

// Chooses the sampler of a run:
//
//   no walls, sizes uniform or given | speculative, k < 4, sample not too large |
//   SpeculativeSampler
//                                    | else                                     | RingSampler
//   walls, faces meshed, k < 4,      | a domain of R^k                          | SolidSampler
//   sizes uniform                    | else, unless speculative                 | RingSampler
//
// Null in all other cases, where sizes are both given and speculative, and where the seeds found
// are dense (a sample themselves, or a large part of a coarse mesh): refinement alone makes the
// sample. The engine must outlive the sampler; `spec` is the engine's.
template <int K>
std::unique_ptr<Sampler<K>> SamplerFor(Engine<K>& engine, const Specification& spec,
                                       const AnsweredPoints& seeds);

}  // namespace stellate::core
