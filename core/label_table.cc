#include "core/label_table.h"

#include <cmath>

#include "core/base/random.h"

namespace stellate::core {
namespace {

// Calls visit(part) for each subset of a set, the set itself first.
template <typename Visit>
void ForEachSubset(WallSet set, const Visit& visit) {
  for (WallSet part = set;; part = (part - 1) & set) {
    visit(part);
    if (part == 0) return;
  }
}

}  // namespace

bool LabelTable::IsPossible(WallSet signs, WallSet unknown) const {
  bool is_possible = false;
  ForEachSubset(unknown, [&](WallSet part) {
    is_possible = is_possible || Of((signs & ~unknown) | part) != kImpossible;
  });
  return is_possible;
}

WallSet LabelTable::Active(WallSet face, WallSet signs) const {
  WallSet active = 0;
  face = Close(face);
  const WallSet others = signs & ~face;
  ForEachSubset(face, [&](WallSet part) {
    const int label = Of(others | part);
    if (label == kImpossible) return;
    ForEachWall(face, [&](int wall) {
      const int beyond = Of((others | part) ^ SetOfWall(wall));
      if (beyond != kImpossible && beyond != label) active |= SetOfWall(wall);
    });
  });
  return Close(active);
}

std::uint64_t LabelTable::Piece(WallSet face, WallSet signs) const {
  face = Close(face);
  if (Active(face, signs) != face) return 0;
  const WallSet others = signs & ~face;
  if (face == 0 && Of(others) <= 0) return 0;
  std::uint64_t hash = 1;
  ForEachSubset(face, [&](WallSet part) {
    hash = Mix64(hash + static_cast<std::uint64_t>(Of(others | part)));
  });
  return hash | 1;
}

std::vector<WallSet> LabelTable::Sectors(WallSet face, WallSet signs) const {
  std::vector<WallSet> sectors;
  ForEachSubset(face, [&](WallSet part) {
    const WallSet sector = (signs & ~face) | part;
    if (Of(sector) > 0) sectors.push_back(sector);
  });
  return sectors;
}

WallSet LabelTable::Bounds(WallSet face, WallSet sector) const {
  WallSet bounds = 0;
  ForEachWall(face, [&](int wall) {
    if (Of(sector ^ SetOfWall(wall)) != kImpossible) bounds |= SetOfWall(wall);
  });
  return bounds;
}

std::optional<int> LabelTable::Nearest(WallSet face, WallSet signs,
                                       const double* clearances) const {
  std::optional<int> nearest;
  for (int wall = 0; SetOfWall(wall) < labels_.size(); ++wall)
    if (!IsSubset(SetOfWall(wall), face) && Piece(face | SetOfWall(wall), signs) != 0 &&
        !(nearest && std::abs(clearances[*nearest]) <= std::abs(clearances[wall])))
      nearest = wall;
  return nearest;
}

std::optional<int> LabelTable::Beside(WallSet face, WallSet signs, const double* clearances) const {
  std::optional<int> nearest;
  face = Close(face);
  for (int wall = 0; SetOfWall(wall) < labels_.size(); ++wall) {
    if (IsSubset(SetOfWall(wall), face)) continue;
    // On the face the walls that are zero together with this one change their signs with it.
    const WallSet beyond = signs ^ (Close(face | SetOfWall(wall)) & ~face);
    if (Piece(face, beyond) != 0 &&
        !(nearest && std::abs(clearances[*nearest]) <= std::abs(clearances[wall])))
      nearest = wall;
  }
  return nearest;
}

std::optional<int> LabelTable::Between(WallSet face, WallSet signs, WallSet wanted,
                                       const double* clearances) const {
  std::optional<int> farthest;
  ForEachWall((signs ^ wanted) & ~face, [&](int wall) {
    const WallSet with = face | SetOfWall(wall);
    if (Piece(with, signs) == 0 && Piece(with, wanted) == 0) return;
    if (!farthest || std::abs(clearances[*farthest]) < std::abs(clearances[wall])) farthest = wall;
  });
  return farthest;
}

}  // namespace stellate::core
