#pragma once

#include <utility>
#include <vector>

#include "core/walls.h"

namespace stellate::core {

// Walls that depend on each other: where three phases meet, f_1 = f_2 = f_3, the walls f_1 - f_2,
// f_2 - f_3 and f_1 - f_3 are all zero, and yet that face has the dimension k - 2. Known are sets
// of walls: each wall of a set is zero wherever all others of it are. Without any, all walls are
// independent.
class Closures {
 public:
  Closures() = default;
  explicit Closures(std::vector<WallSet> sets) : sets_(std::move(sets)) {}

  bool empty() const { return sets_.empty(); }
  const std::vector<WallSet>& sets() const { return sets_; }

  // Returns all walls that are zero wherever those of a face are.
  WallSet Close(WallSet face) const {
    for (bool grows = !sets_.empty() && (face & (face - 1)) != 0; grows;) {
      grows = false;
      for (const WallSet set : sets_)
        if (CountWalls(set & ~face) == 1) {
          face |= set;
          grows = true;
        }
    }
    return face;
  }
  // Returns how many of its walls a face takes: the others are zero where these are.
  int Codimension(WallSet face) const {
    if (sets_.empty()) return CountWalls(face);
    int count = 0;
    WallSet spanned = 0;
    ForEachWall(face, [&](int wall) {
      if (IsSubset(SetOfWall(wall), spanned)) return;
      spanned = Close(spanned | SetOfWall(wall));
      ++count;
    });
    return count;
  }

 private:
  std::vector<WallSet> sets_;
};

}  // namespace stellate::core
