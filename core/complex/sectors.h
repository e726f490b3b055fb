#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/label_table.h"

namespace stellate::core {

// The sectors of the points of a sample. A point on walls of an arrangement has a sector on each
// side of them that is in M, with a star of its own; any other point has one sector, all of its
// tangent cone. Without labels every point has one, and nothing is stored.
class Sectors {
 public:
  explicit Sectors(LabelTable labels = {}) : labels_(std::move(labels)) {}

  const LabelTable& labels() const { return labels_; }

  // Takes the next point, with the walls that it is on and the signs of all others.
  void Add(WallSet walls, WallSet signs) {
    if (labels_.empty()) return;
    const std::size_t id = signs_.size();
    signs_.push_back(signs);
    if (walls == 0) return;
    at_.resize(id + 1, sectors_.size());
    const std::vector<WallSet> sectors = labels_.Sectors(walls, signs);
    sectors_.insert(sectors_.end(), sectors.begin(), sectors.end());
    at_.push_back(sectors_.size());
  }

  int Count(std::uint32_t id) const {
    const std::size_t next = std::size_t{id} + 1;
    return next < at_.size() ? std::max(1, static_cast<int>(at_[next] - at_[id])) : 1;
  }
  // Returns the signs of all walls at a point, those that it is on aside.
  WallSet Signs(std::uint32_t id) const { return labels_.empty() ? 0 : signs_[id]; }
  // Returns the signs of all walls in a sector.
  WallSet SignsOf(std::uint32_t id, int sector) const {
    const std::size_t next = std::size_t{id} + 1;
    return next < at_.size() && at_[next] > at_[id]
               ? sectors_[at_[id] + static_cast<std::size_t>(sector)]
               : Signs(id);
  }
  // Returns the same for each sector of a point that need not be in the sample. Without labels: all
  // of its walls are positive.
  std::vector<WallSet> Of(WallSet walls, WallSet signs) const {
    return labels_.empty() ? std::vector<WallSet>{walls}
           : walls == 0    ? std::vector<WallSet>{signs}
                           : labels_.Sectors(walls, signs);
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
  std::vector<WallSet> sectors_;
};

}  // namespace stellate::core
