#pragma once

#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "core/refinement/engine.h"
#include "core/run/crease_probe.h"

namespace stellate::core {

// Decides when to test whether M is smooth where rules keep failing (CreaseProbe).
class CreaseWatch {
 public:
  // Call it when a star on the advancing front was fixed since the last round.
  void NoteFrontMoved() { front_moved_ = true; }
  // Whether no recent round has reduced the violations, `left` now, by much. Call it once a round.
  // judges_all: R3 and R4 are among them. After it was true, it is true again much later.
  bool IsDue(std::uint64_t left, bool judges_all);
  // Whether to test short steep edges, which are conclusive by themselves, also while a front
  // moves.
  bool MayLookAgain() const { return rounds_ % 4 == 0 && rounds_ <= kLongestFront; }

 private:
  // The front of a run that ends by itself rests after so many rounds, and then such a run halves
  // its violations in fewer.
  static constexpr std::uint64_t kLongestFront = 100;

  bool front_moved_ = false;
  bool judged_all_ = false;                      // in the round before
  std::uint64_t left_then_ = ~std::uint64_t{0};  // at the last progress
  std::uint64_t rounds_ = 0, rounds_since_ = 0, patience_ = 16;
};

constexpr double kLeastSine2 = 0.03;  // ten degrees

// Edges that were probed before, as pairs of vertices, the smaller first.
using WalkedEdges = std::set<std::pair<std::uint32_t, std::uint32_t>>;

// Returns a few edges at stars that break a rule, without common ends, along which M's tangent
// spaces turn most, in all and for their length. They are no longer than `longest` or, where sizes
// are finer, than that share of it, and no shorter than the error that points of M may have. The
// squared sines of the angles along each add up to at least least_sine2. Edges in `walked` were
// returned before and are left out, as the answers would be the same; the others are added to it.
template <int K>
std::vector<Way> SteepWaysAtFaults(const Engine<K>& engine, double longest,
                                   double least_sine2 = kLeastSine2, WalkedEdges* walked = nullptr);

// Returns such edges of the whole sample.
template <int K>
std::vector<Way> SteepWays(const Stars<K>& stars, double longest);

}  // namespace stellate::core
