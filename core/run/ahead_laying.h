#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/run/laying.h"
#include "core/run/ring_laying.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {

// Lays the sample in a handful of round trips. On what the stars of the seeds guess of M
// (core/refinement/surrogate.h) a sample several times as coarse is grown, asked for at once, and
// refined where it has to be; on what that guesses one of the final spacing, asked for at once as
// well, with what R1 and R2 will ask for if it is right. Of the coarse points those that patches
// begin from are of the sample, from when they are found. Where seeds that are given tell too
// little the coarse sample is laid ring by ring; where the coarse mesh does not come about the
// final one is.
template <int K>
class AheadLaying final : public Laying<K> {
 public:
  // Both are borrowed; `spec` is the engine's.
  AheadLaying(Engine<K>& engine, const Specification& spec);

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
  void LayCoarse();
  void GiveUp();
  void JudgeCoarse();
  PlannedPoints GrowOnGuesses(std::uint64_t round);
  PlannedPoints RefineGuessed(const PlannedPoints& grown, std::uint64_t round);
  std::vector<std::uint8_t> LayThoseApart(Engine<K>& engine, double spacing,
                                          const AnsweredPoints& answers);

  Engine<K>& engine_;
  const Specification& spec_;
  double spacing_;
  enum class Stage {
    kSeeds,        // they are the coarse sample
    kGrown,        // that was grown on what they tell
    kCoarseRings,  // it is laid ring by ring
    kCoarse,       // the coarse mesh is refined
    kGuessed,      // the sample was grown on what it tells
    kRings,        // the sample is laid ring by ring
  };
  Stage stage_ = Stage::kSeeds;
  std::unique_ptr<Engine<K>> coarse_;
  bool is_coarse_in_rings_ = false;     // laid so
  int rounds_ = 0;                      // of the coarse mesh
  std::optional<Surrogate<K>> guess_;   // of the coarse mesh
  std::optional<RingLaying<K>> rings_;  // of either sample
  BallTree scouts_;                     // the sample until then
  Eigen::MatrixXd asked_;               // what was grown, while it is asked for
};

STELLATE_DECLARE_CLASS(AheadLaying)

}  // namespace stellate::core
