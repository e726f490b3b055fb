#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/parts/boxes.h"
#include "core/peers.h"

namespace stellate::core {

// A part's share of space, and the others that it borders on.
//
//   const Territory territory(peers, Boxes(sample, d, peers.parts()));
//   if (territory.Owns(point)) own.push_back(0);
class Territory {
 public:
  // The whole.
  Territory();
  // `peers` is borrowed. REQUIRES: a box a part
  Territory(const Peers& peers, Boxes boxes) : peers_(&peers), boxes_(std::move(boxes)) {}

  const Peers& peers() const { return *peers_; }
  bool is_whole() const { return peers_->parts() == 1; }
  bool Owns(const double* point) const { return boxes_.OwnerOf(point) == peers_->part(); }
  // As Boxes::ForEachNear.
  template <typename Visit>
  void ForEachNear(const double* point, double halo, const Visit& visit) const {
    boxes_.ForEachNear(point, halo, visit);
  }

 private:
  const Peers* peers_;
  Boxes boxes_;
};

// Things that a part lists with some of others': by part, its own that the other lists too, and the
// other's that it lists itself. Each part's list of what another shows it is in the order of that
// one's list.
struct Borders {
  std::vector<std::vector<std::uint32_t>> shown, seen;  // places in its list
};

}  // namespace stellate::core
