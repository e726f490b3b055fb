#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/index/ball_tree.h"
#include "core/sampling/ring_sampler.h"
#include "core/sampling/sampler.h"
#include "core/speculation/surrogate.h"

namespace stellate::core {

// Samples M in a handful of round trips, on surrogates of it (core/speculation/surrogate.h):
//
//   1. grow a coarse sample on the surrogate of the seeds, query it in one batch, and refine it;
//   2. grow the final sample on the surrogate of the coarse mesh, run R1 and R2 speculatively on
//      it, and query all of these points in one batch.
//
// Coarse points that patches start from join the sample when they are found. If the given seeds
// determine too little of M, the coarse sample grows ring by ring; if there is no usable coarse
// mesh, the final sample does.
template <int K>
class SpeculativeSampler final : public Sampler<K> {
 public:
  // Both must outlive the sampler; `spec` is the engine's.
  SpeculativeSampler(Engine<K>& engine, const Specification& spec);

  std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) override;
  CandidateSet<K> Next(std::uint64_t round) override;
  std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                 const AnsweredPoints& answers) override;
  const Engine<K>& asking() const override {
    return stage_ == Stage::kGuessed || stage_ == Stage::kRings ? engine_ : *coarse_;
  }
  Surrogate<K>* guess() override { return guess_ ? &*guess_ : nullptr; }
  double CountMissing() const override;

 private:
  std::vector<std::uint8_t> Scout(const AnsweredPoints& answers,
                                  const std::vector<std::uint8_t>& found);
  double BadShare() const;  // of the coarse mesh's stars
  CandidateSet<K> RefineCoarse(std::uint64_t round);
  struct Grown;
  Grown Grow(Surrogate<K>& guess, double spacing, const AnsweredPoints& starts,
             const AnsweredPoints& others) const;
  double coarse_spacing() const;
  PlannedPoints GrowCoarse();
  void SampleCoarse();
  void GiveUp();
  void JudgeCoarse();
  PlannedPoints GrowOnGuesses(std::uint64_t round);
  PlannedPoints RefineGuessed(const PlannedPoints& grown, std::uint64_t round);
  std::vector<std::uint8_t> AddThoseApart(Engine<K>& engine, double spacing,
                                          const AnsweredPoints& answers);

  Engine<K>& engine_;
  const Specification& spec_;
  double spacing_;
  enum class Stage {
    kSeeds,        // the seeds are the coarse sample
    kGrown,        // the coarse sample was grown on the seeds' surrogate
    kCoarseRings,  // the coarse sample grows ring by ring
    kCoarse,       // the coarse mesh is refined
    kGuessed,      // the sample was grown on the coarse mesh's surrogate
    kRings,        // the sample grows ring by ring
  };
  Stage stage_ = Stage::kSeeds;
  std::unique_ptr<Engine<K>> coarse_;
  bool is_coarse_in_rings_ = false;      // the coarse sample grew ring by ring
  int rounds_ = 0;                       // of the coarse mesh
  std::optional<Surrogate<K>> guess_;    // of the coarse mesh
  std::optional<RingSampler<K>> rings_;  // of either sample
  BallTree scouts_;                      // the sample until then
  Eigen::MatrixXd asked_;                // what was grown, while it is queried
};

STELLATE_DECLARE_CLASS(SpeculativeSampler)

}  // namespace stellate::core
