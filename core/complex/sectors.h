#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/label_table.h"

namespace stellate::core {

// A side of the walls of a point.
struct Sector {
  WallSet signs = 0;   // of all walls, in it
  WallSet bounds = 0;  // of the point's walls, those that bound it
};

// The sectors of the points of a sample. A point on walls of an arrangement has a sector on each
// side of them that is in M, with a star of its own; any other point has one sector, all of its
// tangent cone. Without labels every point has one, and nothing is stored.
class Sectors {
 public:
  explicit Sectors(LabelTable labels = {}) : labels_(std::move(labels)) {}

  const LabelTable& labels() const { return labels_; }

  // Takes the next point, with the walls that it is on and the signs of all others. `sectors`: of
  // it.
  void Add(WallSet walls, WallSet signs, const std::vector<Sector>& sectors) {
    if (labels_.empty()) return;
    const std::size_t id = signs_.size();
    signs_.push_back(signs);
    if (walls == 0) return;
    at_.resize(id + 1, sectors_.size());
    sectors_.insert(sectors_.end(), sectors.begin(), sectors.end());
    at_.push_back(sectors_.size());
  }

  int Count(std::uint32_t id) const {
    const std::size_t next = std::size_t{id} + 1;
    return next < at_.size() ? std::max(1, static_cast<int>(at_[next] - at_[id])) : 1;
  }
  // Returns the signs of all walls at a point, those that it is on aside.
  WallSet Signs(std::uint32_t id) const { return labels_.empty() ? 0 : signs_[id]; }
  // REQUIRES: there are labels.
  Sector At(std::uint32_t id, int sector) const {
    const std::size_t next = std::size_t{id} + 1;
    return next < at_.size() && at_[next] > at_[id]
               ? sectors_[at_[id] + static_cast<std::size_t>(sector)]
               : Sector{Signs(id), 0};
  }
  // Returns the signs of all walls in a sector.
  WallSet SignsOf(std::uint32_t id, int sector) const {
    return labels_.empty() ? 0 : At(id, sector).signs;
  }
  // Returns the sectors of a point that need not be in the sample, on walls all of whose possible
  // signs occur there. Without labels: all of its walls are positive.
  std::vector<Sector> Of(WallSet walls, WallSet signs) const {
    if (labels_.empty()) return {{walls, walls}};
    if (walls == 0) return {{signs, 0}};
    std::vector<Sector> sectors;
    for (const WallSet sector : labels_.Sectors(walls, signs))
      sectors.push_back({sector, labels_.Bounds(walls, sector)});
    return sectors;
  }
  // Identifies the piece of the face of `walls` in a sector, as LabelTable::Piece does; 1 without
  // labels.
  std::uint64_t Piece(std::uint32_t id, int sector, WallSet walls) const {
    return labels_.empty() ? 1 : labels_.Piece(walls, SignsOf(id, sector));
  }
  // Returns the label of a sector; 1 without labels.
  int Label(std::uint32_t id, int sector) const {
    return labels_.empty() ? 1 : labels_.Of(SignsOf(id, sector));
  }

 private:
  LabelTable labels_;
  std::vector<WallSet> signs_;  // by point
  // Where the sectors of each point begin, up to the last on a wall, and the end.
  std::vector<std::size_t> at_;
  std::vector<Sector> sectors_;
};

}  // namespace stellate::core
