#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/run/laying.h"
#include "core/run/ring_laying.h"
#include "core/sample/ball_tree.h"

namespace stellate::core {

// Lays the sample in a handful of round trips: a mesh several times as coarse is refined first,
// asking ahead; on what that guesses of M (core/refinement/surrogate.h) a sample of the final
// spacing is grown, and asked for at once. Of the coarse mesh's points those that patches begin
// from are of the sample, from when they are found. Where that mesh does not come about the sample
// is laid ring by ring after all.
template <int K>
class AheadLaying final : public Laying<K> {
 public:
  // Both are borrowed; `spec` is the engine's.
  AheadLaying(Engine<K>& engine, const Specification& spec);

  std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) override;
  CandidateSet<K> Next(std::uint64_t round) override;
  std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                 const AnsweredPoints& answers) override;
  const Engine<K>& asking() const override { return guess_ || rings_ ? engine_ : *coarse_; }
  Surrogate<K>* guess() override { return guess_ ? &*guess_ : nullptr; }
  double CountMissing() const override;

 private:
  std::vector<std::uint8_t> Scout(const AnsweredPoints& answers,
                                  const std::vector<std::uint8_t>& found);
  double BadShare() const;  // of the coarse mesh's stars
  CandidateSet<K> RefineCoarse(std::uint64_t round);
  PlannedPoints GrowOnGuesses();
  std::vector<std::uint8_t> AreTooNear(const std::vector<double>& points, std::size_t first,
                                       const std::vector<Eigen::Index>& columns) const;
  std::vector<std::uint8_t> LayThoseApart(const AnsweredPoints& answers);

  Engine<K>& engine_;
  const Specification& spec_;
  double spacing_;
  std::unique_ptr<Engine<K>> coarse_;
  int rounds_ = 0;                      // of its refinement
  std::optional<Surrogate<K>> guess_;   // of the coarse mesh, from when the sample is asked for
  std::optional<RingLaying<K>> rings_;  // where nothing can be guessed
  BallTree scouts_;                     // the sample until then
  Eigen::MatrixXd asked_;               // the sample, guessed, while it is asked for
};

STELLATE_DECLARE_CLASS(AheadLaying)

}  // namespace stellate::core
