#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/engine.h"
#include "core/run/crease_probe.h"
#include "core/run/crease_watch.h"

namespace stellate::core {

// Finds out that M is not smooth: by queries that go with those of a round, and before a run gives
// up.
//
//   search.Watch(engine);                         // once a round
//   if (search.is_asking()) search.Ask(&blocks);  // with the round's queries
//   search.Absorb(answers);
//   if (search.crease()) ...
template <int K>
class CreaseSearch {
 public:
  explicit CreaseSearch(const Specification& spec);

  // Call it when a star on the advancing front was fixed since the last round.
  void NoteFrontMoved() { watch_.NoteFrontMoved(); }
  // Probes steep edges once rules have kept failing for a while. Call it once a round.
  void Watch(const Engine<K>& engine);
  // Probe now: steep edges where rules fail, or of the whole mesh.
  void ProbeFaults(const Engine<K>& engine);
  void ProbeAll(const Stars<K>& stars);
  // Call it once every rule holds. Forgets edges that were not probed to their end.
  void Stop();

  bool is_asking() const { return probe_.is_asking(); }
  const std::optional<Crease>& crease() const { return probe_.crease(); }

  // Adds its block of queries. REQUIRES: is_asking().
  void Ask(std::vector<QueryBlock>* blocks);
  // Takes its block of the answers, if it has asked.
  void Absorb(const std::vector<AnswerBlock>& answers);

 private:
  double epsilon_;
  bool is_domain_;  // of R^d, which bends nowhere
  CreaseProbe probe_;
  CreaseWatch watch_;
  WalkedEdges walked_;                // edges that rounds have probed
  std::optional<std::size_t> block_;  // the probe's, among the open ones
};

STELLATE_DECLARE_CLASS(CreaseSearch)

}  // namespace stellate::core
