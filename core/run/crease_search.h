#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/refinement/engine.h"
#include "core/run/crease_probe.h"
#include "core/run/crease_watch.h"
#include "core/run/dimension_probe.h"

namespace stellate::core {

// Finds out that M is not smooth, or has another dimension: by queries that go with those of a
// round, and before a run gives up.
//
//   search.Watch(engine);                         // once a round
//   if (search.is_asking()) search.Ask(&blocks);  // with the round's queries
//   search.Absorb(answers);
//   verdict += search.Describe();
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

  // Looks at a few vertices for more dimensions, besides.
  void ProbeDimension(const Engine<K>& engine);

  bool is_asking() const { return probe_.is_asking() || dimension_.is_asking(); }
  const std::optional<Crease>& crease() const { return probe_.crease(); }
  // Says what was found and what to do, for people; "" if nothing was.
  std::string Describe() const;

  // Adds its blocks of queries. REQUIRES: is_asking().
  void Ask(std::vector<QueryBlock>* blocks);
  // Takes its blocks of the answers, if it has asked.
  void Absorb(const std::vector<AnswerBlock>& answers);

 private:
  double epsilon_;
  bool is_domain_;  // of R^d, which bends nowhere
  CreaseProbe probe_;
  CreaseWatch watch_;
  DimensionProbe dimension_;
  WalkedEdges walked_;  // edges that rounds have probed
  // Those that have asked, and the block of each among the open ones.
  std::vector<std::pair<QuerySource*, std::size_t>> open_;
};

STELLATE_DECLARE_CLASS(CreaseSearch)

}  // namespace stellate::core
