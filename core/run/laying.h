#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/instantiate.h"
#include "core/growth/growth.h"
#include "core/refinement/engine.h"

namespace stellate::core {

// Lays the sample at its final spacing before there is any star: what is asked and what joins, ring
// by ring (core/growth/growth.h). A lattice ten times as coarse goes before, to have a seed near
// everything.
template <int K>
class Laying {
 public:
  // Whether a run begins so: sizes are the same everywhere, what was found of the seeds is not
  // dense (a sample itself, or all that so coarse a mesh needs), and round trips are not to be
  // saved.
  static bool Suits(const ResolvedCriteria& criteria, const AnsweredPoints& seeds);

  explicit Laying(Engine<K>& engine);  // borrowed

  // Begins from those of the seeds that were found. Returns which of them joined the sample.
  std::vector<std::uint8_t> Begin(const AnsweredPoints& seeds);

  // What to ask next; empty when the sample is laid, as far as it can be.
  PlannedPoints Next();
  // Takes the answers. Returns which of them joined the sample.
  std::vector<std::uint8_t> Take(const AnsweredPoints& answers);

  // About how many points are still to come.
  double CountMissing() const;

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

STELLATE_DECLARE_CLASS(Laying)

}  // namespace stellate::core
