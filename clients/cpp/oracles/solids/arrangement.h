#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "oracles/solids/tree.h"

namespace stellate::solids {

// Walls whose sign vectors are all gone through.
inline constexpr size_t kMostInTables = 16;

// A wall, and whether it is positive.
using Literal = std::pair<size_t, bool>;
// Of sign vectors, one each: 1 inside and 0 outside, -1 where no point has it; or labels from 0 on.
using Labelling = std::vector<std::int8_t>;

// A tree's walls, each once, and the labels of their sign vectors. A sign vector is a number with
// bit i where wall i is positive.
class Arrangement {
 public:
  explicit Arrangement(NodePtr tree);

  const std::vector<WallPtr>& walls() const { return walls_; }

  // 2^m: 1 inside, 0 outside, -1 where no point is known to be able to have the signs. Throws
  // std::invalid_argument for too many walls.
  Labelling Labels() const;
  // Whether sign vectors are inside of a tree whose walls are among these: 2^m.
  std::vector<bool> Inside(const Node& node) const;
  // Whether a point is inside, by the walls' signs there.
  bool InsideAt(const std::vector<bool>& signs) const;

  // The signs that all of the inside has, and nothing else, as few as will do; nothing where that
  // is not all there is to say of the inside, and `why_not` says why. Throws std::invalid_argument.
  std::optional<std::vector<Literal>> Literals(std::string* why_not) const;

 private:
  Literal Number(const SolidWall& wall) const { return numbers_.at(&wall); }
  bool InsideAt(const Node& node, const std::vector<bool>& signs) const;
  // The signs whose conjunction the node, or its complement, is; nothing if it is none.
  std::optional<std::set<Literal>> Conjunction(const Node& node, bool positive = true) const;
  // Signs that no point has together: of parallel planes, of balls, of planes beyond a hull.
  std::vector<std::vector<Literal>> Impossible() const;
  void AddImpossibleOfBodies(const Node& node, std::vector<std::vector<Literal>>* cubes) const;
  std::optional<std::vector<Literal>> Fewest(const Labelling& labels, std::string* why_not) const;

  NodePtr tree_;
  std::vector<WallPtr> walls_;
  std::map<const SolidWall*, Literal> numbers_;  // and whether it is that one, or its other side
};

// Leaves out the walls whose sign makes no difference: if no two points that differ in it alone
// have different labels.
void LeaveOutIdle(std::vector<WallPtr>* walls, Labelling* labels);

}  // namespace stellate::solids
