#pragma once

#include <cstdint>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/engine.h"

namespace stellate::core {

template <int K>
class Surrogate;

// Makes the initial sample at its final spacing, before there is any star:
//
//   sampler->Begin(seeds);
//   while ((candidates = sampler->Next(round)).size() > 0) sampler->Take(candidates, answers);
//
// SamplerFor (core/run/sampler_choice.h) chooses one. No QuerySource: it names candidates, and the
// RoundTrip that queries them finds flats and tangents for any oracle.
template <int K>
class Sampler {
 public:
  virtual ~Sampler() = default;
  Sampler(const Sampler&) = delete;
  Sampler& operator=(const Sampler&) = delete;

  // Begins from the seeds that were found. Returns which of them joined the sample.
  virtual std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) = 0;

  // Returns the points to query next; empty when the sample is complete, or cannot be continued.
  // round: as for Engine::Draw.
  virtual CandidateSet<K> Next(std::uint64_t round) = 0;
  // Takes the answers to Next. Returns which of them joined the sample.
  virtual std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                         const AnsweredPoints& answers) = 0;
  // The engine whose stars the last candidates refer to.
  virtual const Engine<K>& asking() const = 0;

  // Returns the surrogate that it used, or null. Refine on it, too, while the sampler exists.
  virtual Surrogate<K>* guess() { return nullptr; }

  // Estimates how many points are still to come.
  virtual double CountMissing() const = 0;

 protected:
  Sampler() = default;
};

// Adds columns of the answers to the sample, up to its limit. Returns which columns were added.
template <int K>
std::vector<std::uint8_t> AddToSample(Engine<K>& engine, const AnsweredPoints& answers,
                                      const std::vector<Eigen::Index>& columns);

// The lattice's nearest-neighbour distance for circumradii of epsilon, length.
double SampleSpacing(int k, double epsilon);
// The distance between the starts of patches, in spacings. If smaller, the seams between patches
// cost more vertices; if larger, the strain within them does.
inline constexpr double kPatchesApart = 10;

// The most points to grow on a surrogate before they are queried, in one batch.
std::uint64_t MaxPointsPerBatch(int k, int d);

// Returns the points' sizes in epsilon, if sizes are graded and given; else nothing.
template <int K>
Eigen::VectorXd SharesOf(const SizeField<K>& sizes, const AnsweredPoints& answers);

// Counts those of the first `most` found points that lie at least `apart` (times their share) from
// all points counted before.
std::size_t CountApart(const AnsweredPoints& from, Eigen::Index most, double apart,
                       const Eigen::VectorXd& shares = {});

}  // namespace stellate::core
