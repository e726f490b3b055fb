#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/growth/growth.h"
#include "core/run/interior_room.h"
#include "core/run/laying.h"

namespace stellate::core {

// What is asked is what joins, ring by ring (core/growth/growth.h). A coarser lattice goes before,
// to have a seed near everything; but where all that was drawn in a box is within its spacing of
// one seed. Of a manifold with boundary it is the interior that is laid, as far as there is room.
template <int K>
class RingLaying final : public Laying<K> {
 public:
  // The engine is borrowed; of `spec` only its walls and whether it gives seeds are heeded.
  // apart: of patches, in spacings of the lattice.
  RingLaying(Engine<K>& engine, const Specification& spec, double apart = kPatchesApart);

  std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) override;
  // In place of Begin: from the sample as it is, and from seeds where no patch comes.
  void GoOn(const AnsweredPoints& sample, const AnsweredPoints& seeds);
  CandidateSet<K> Next(std::uint64_t round) override;
  std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                 const AnsweredPoints& answers) override;
  const Engine<K>& asking() const override { return engine_; }
  double CountMissing() const override;

 private:
  Growth<K>& growing() { return scouting_ ? *scouting_ : growth_; }
  typename Growth<K>::Ring NextRing();
  AnsweredPoints InRoom(const AnsweredPoints& answers);
  std::vector<std::uint8_t> Scout(const AnsweredPoints& answers,
                                  const std::vector<Eigen::Index>& columns);

  Engine<K>& engine_;
  const bool are_drawn_;  // the seeds, from a box
  const double apart_;    // patches, in spacings
  Growth<K> growth_;
  std::unique_ptr<Growth<K>> scouting_;  // the coarse lattice, until it is laid
  AnsweredPoints seeds_, scouts_;        // as given; of the coarse lattice
  std::optional<InteriorRoom<K>> room_;  // between walls
  Eigen::Index proposed_ = 0;            // of the ring that was asked for last
  std::vector<Eigen::Index> asked_;      // its columns for which there was room
};

STELLATE_DECLARE_CLASS(RingLaying)

}  // namespace stellate::core
