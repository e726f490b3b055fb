#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/closures.h"
#include "core/walls.h"

namespace stellate::core {

// An arrangement of walls: each sign vector, a bit for each wall that is set where g_i >= 0, has a
// label. M is where the label is not 0, and its regions are where it is 1, 2, ... Signs that no
// point can have are impossible. Without a table M is where all walls are >= 0, and has one region.
//
// A wall, or a face of several, is live only where labels differ across it. Elsewhere it is of no
// concern, and need not even be smooth.
class LabelTable {
 public:
  LabelTable() = default;  // no table
  // labels    of each of the 2^walls sign vectors, 0 or more, or kImpossible; empty: no table
  // closures  of walls that depend on each other; faces may then be given by any of their walls
  explicit LabelTable(std::vector<std::int8_t> labels, Closures closures = {})
      : labels_(std::move(labels)), closures_(std::move(closures)) {}

  static constexpr int kImpossible = -1;

  bool empty() const { return labels_.empty(); }
  const Closures& closures() const { return closures_; }
  // Without a table, too.
  WallSet Close(WallSet face) const { return closures_.Close(face); }
  int Codimension(WallSet face) const { return closures_.Codimension(face); }
  // REQUIRES of all below: !empty()
  int Of(WallSet signs) const { return labels_[signs]; }
  // Whether a point may have these signs, if those of the walls of `unknown` do not count.
  bool IsPossible(WallSet signs, WallSet unknown) const;
  // Returns the walls of `face` across which the label differs, for some signs of the others, and
  // all that are zero where these are. `signs`: of the walls that are not in `face`; those of the
  // others do not count.
  WallSet Active(WallSet face, WallSet signs) const;
  // Identifies the piece of a face around a point: two points of a face are on the same piece if
  // the labels on all its sides are the same. 0: the face is not live there.
  std::uint64_t Piece(WallSet face, WallSet signs) const;
  // Returns the labels on the negative and on the positive side of one wall.
  std::pair<int, int> Sides(WallSet wall, WallSet signs) const {
    return {Of(signs & ~wall), Of(signs | wall)};
  }
  // Returns the sign vectors with a region, of those that differ from `signs` in walls of `face`
  // alone: the sectors of a point on that face.
  std::vector<WallSet> Sectors(WallSet face, WallSet signs) const;
  // Returns the walls of `face` that bound a sector: beyond each of them is another.
  WallSet Bounds(WallSet face, WallSet sector) const;

  // Returns the wall that is the nearest, by its clearance, of those that meet `face` in a live
  // face of one dimension less near a point; nothing if none does. `clearances`: of all walls
  // there.
  std::optional<int> Nearest(WallSet face, WallSet signs, const double* clearances) const;
  // Returns the wall at which to look for the live face beside a point of `face` that is on no
  // live piece of it, or on another than `wanted` signs have: nothing if no wall will do.
  std::optional<int> Beside(WallSet face, WallSet signs, const double* clearances) const;
  std::optional<int> Between(WallSet face, WallSet signs, WallSet wanted,
                             const double* clearances) const;

 private:
  std::vector<std::int8_t> labels_;
  Closures closures_;
};

// Returns the signs of clearances. `walls`: how many they are.
inline WallSet SignsOf(const double* clearances, int walls) {
  WallSet signs = 0;
  for (int wall = 0; wall < walls; ++wall)
    if (clearances[wall] >= 0) signs |= SetOfWall(wall);
  return signs;
}

}  // namespace stellate::core
