#pragma once

#include <vector>

#include "core/index/ball_tree.h"
#include "core/sampling/growth.h"
#include "core/sampling/interior_clearance.h"
#include "core/sampling/sampler.h"

namespace stellate::core {

// Samples the interior of a domain of R^k whose boundary is meshed, by one lattice. Each point
// there is its own closest point, so only points that may lie beyond a wall are queried.
template <int K>
class SolidSampler final : public Sampler<K> {
 public:
  explicit SolidSampler(Engine<K>& engine);  // borrowed

  std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) override;
  CandidateSet<K> Next(std::uint64_t round) override;
  std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                 const AnsweredPoints& answers) override;
  const Engine<K>& asking() const override { return engine_; }
  double CountMissing() const override { return 2.0 * static_cast<double>(growth_.border()); }

 private:
  void Grow();
  bool BeginFromNextSeed();
  bool Doubt(const double* point);

  Engine<K>& engine_;
  Growth<K> growth_;
  InteriorClearance<K> clearance_;
  AnsweredPoints seeds_;
  std::vector<double> doubted_;  // d each: all that were queried, or will be next
  BallTree doubts_;              // of them
  std::size_t asked_ = 0;        // of them
};

STELLATE_DECLARE_CLASS(SolidSampler)

}  // namespace stellate::core
