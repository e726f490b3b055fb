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
  // Whether no round of late has left much less than `left` violations. Called once a round;
  // judges_all: R3 and R4 are among them. After it was so, it is so again much later.
  bool IsDue(std::uint64_t left, bool judges_all);
  // Whether it is time to look at what tells by itself, also while a front moves.
  bool MayLookAgain() const { return rounds_ % 4 == 0 && rounds_ <= kLongestFront; }

 private:
  // In fewer rounds runs that end by themselves halve what is left, once their front rests; and in
  // so many it rests, if it ever does.
  static constexpr std::uint64_t kLongestFront = 100;

  bool front_moved_ = false;
  bool judged_all_ = false;                      // in the round before
  std::uint64_t left_then_ = ~std::uint64_t{0};  // at the last progress
  std::uint64_t rounds_ = 0, rounds_since_ = 0, patience_ = 16;
};

constexpr double kLeastSine2 = 0.03;  // ten degrees

// Edges along which it was asked before, as pairs of vertices, the smaller first.
using WalkedEdges = std::set<std::pair<std::uint32_t, std::uint32_t>>;

// A few edges at stars that break a rule, without common ends, along which M's tangent spaces turn
// most: by how much, and for their length. They are no longer than `longest` or, where sizes are
// finer, than that share of it; no shorter than the error that points of M may have; and the
// squared sines of the angles along each add up to least_sine2 at least. `walked` has those that
// were returned before, which are left out, as they would be answered alike; the others are added.
template <int K>
std::vector<Way> SteepWaysAtFaults(const Engine<K>& engine, double longest,
                                   double least_sine2 = kLeastSine2, WalkedEdges* walked = nullptr);

// The same of the whole sample.
template <int K>
std::vector<Way> SteepWays(const Stars<K>& stars, double longest);

}  // namespace stellate::core
