#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "core/run/sampler_choice.h"
#include "core/sampling/sampler.h"

namespace stellate::core {

// The initial sample of a run: of M, or of its inside once its faces are meshed.
//
//   if (sample.Begin(engine, spec, seeds, &used))
//     while ((candidates = sample.Next(round)).size() > 0) sample.Take(candidates, answers);
//   ...
//   const auto finished = sample.TakeFinished();  // for one round of refinement on its surrogate
template <int K>
class InitialSample {
 public:
  // Chooses a sampler and begins with the seeds that were found; `used`: which of them joined the
  // sample. Returns false if there is none for such a manifold: seeds are then inserted as they
  // are.
  bool Begin(Engine<K>& engine, const Specification& spec, const AnsweredPoints& seeds,
             std::vector<std::uint8_t>* used) {
    sampler_ = SamplerFor<K>(engine, spec, seeds);
    if (sampler_) *used = sampler_->Begin(seeds);
    return sampler_ != nullptr;
  }

  // Whether it has begun and is not complete: there are no stars yet.
  bool is_growing() const { return sampler_ != nullptr; }
  // Whether a sample was completed.
  bool is_done() const { return is_done_; }

  // As those of Sampler. REQUIRES: is_growing().
  CandidateSet<K> Next(std::uint64_t round) { return sampler_->Next(round); }
  std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates, const AnsweredPoints& answers) {
    return sampler_->Take(candidates, answers);
  }
  const Engine<K>& asking() const { return sampler_->asking(); }
  // 0 if it does not grow.
  double CountMissing() const { return sampler_ ? sampler_->CountMissing() : 0; }

  // Call it when the sample is complete.
  void Complete() {
    finished_ = std::move(sampler_);
    is_done_ = true;
  }
  // Returns the sampler after Complete, for the surrogate that it used; null later.
  std::unique_ptr<Sampler<K>> TakeFinished() { return std::move(finished_); }
  // Releases all memory: the run is over.
  void Drop() {
    sampler_.reset();
    finished_.reset();
  }

 private:
  std::unique_ptr<Sampler<K>> sampler_;   // while it grows
  std::unique_ptr<Sampler<K>> finished_;  // until TakeFinished
  bool is_done_ = false;
};

}  // namespace stellate::core
