#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/sampling/interior_clearance.h"
#include "core/sampling/sampler.h"
#include "core/sampling/shared_growth.h"

namespace stellate::core {

// Grows the lattice ring by ring (core/sampling/growth.h), with one round trip a ring. A coarser
// lattice of scouts grows first, to have a seed near every part of M, unless all random seeds fell
// within one spacing. On a manifold with boundary it samples the interior, where InteriorClearance
// allows it.
template <int K>
class RingSampler final : public Sampler<K> {
 public:
  // The engine must outlive the sampler. Uses of `spec` only its walls, its oracle's
  // capabilities and whether it has seeds.
  // apart: the distance between patches, in spacings of the lattice.
  RingSampler(Engine<K>& engine, const Specification& spec, double apart = kPatchesApart);

  std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) override;
  // In place of Begin: continues from an existing sample, and from seeds that no patch reaches.
  void GoOn(const AnsweredPoints& sample, const AnsweredPoints& seeds);
  CandidateSet<K> Next(std::uint64_t round) override;
  std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                 const AnsweredPoints& answers) override;
  const Engine<K>& asking() const override { return engine_; }
  double CountMissing() const override;

 private:
  SharedGrowth<K>& growing() { return scouting_ ? *scouting_ : growth_; }
  typename Growth<K>::Ring NextRing();
  void GrowFromScouts();
  AnsweredPoints KeepClear(const AnsweredPoints& answers);
  std::vector<std::uint8_t> Scout(const AnsweredPoints& answers,
                                  const std::vector<Eigen::Index>& columns);

  Engine<K>& engine_;
  const bool are_drawn_;  // the seeds, from a box
  const bool predicts_;
  const double apart_;  // patches, in spacings
  SharedGrowth<K> growth_;
  std::unique_ptr<SharedGrowth<K>> scouting_;      // the coarse lattice, until it is complete
  AnsweredPoints seeds_, scouts_;                  // as given; of the coarse lattice
  std::optional<InteriorClearance<K>> clearance_;  // between walls
  Eigen::Index proposed_ = 0;                      // points of the last ring
  std::vector<Eigen::Index> asked_;                // its columns that are clear, and were queried
};

STELLATE_DECLARE_CLASS(RingSampler)

}  // namespace stellate::core
