#pragma once

#include <memory>
#include <vector>

#include "core/growth/growth.h"
#include "core/run/laying.h"

namespace stellate::core {

// What is asked is what joins, ring by ring (core/growth/growth.h). A lattice ten times as coarse
// goes before, to have a seed near everything.
template <int K>
class RingLaying final : public Laying<K> {
 public:
  explicit RingLaying(Engine<K>& engine);  // borrowed

  std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds) override;
  CandidateSet<K> Next(std::uint64_t round) override;
  std::vector<std::uint8_t> Take(const CandidateSet<K>& candidates,
                                 const AnsweredPoints& answers) override;
  const Engine<K>& asking() const override { return engine_; }
  double CountMissing() const override;

 private:
  std::vector<std::uint8_t> Lay(const AnsweredPoints& answers,
                                const std::vector<Eigen::Index>& columns);
  std::vector<std::uint8_t> Scout(const AnsweredPoints& answers,
                                  const std::vector<Eigen::Index>& columns);

  Engine<K>& engine_;
  Growth<K> growth_;
  std::unique_ptr<Growth<K>> scouting_;  // the coarse lattice, until it is laid
  AnsweredPoints seeds_, scouts_;        // as given; of the coarse lattice
};

STELLATE_DECLARE_CLASS(RingLaying)

}  // namespace stellate::core
