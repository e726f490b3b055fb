#pragma once

#include <string>

#include "oracles/solids/tree.h"

namespace stellate::solids {

// A solid of one wall.
struct Single {
  bool inside;  // whether the wall is positive inside, or outside
  WallPtr wall;
  BodyPtr hull;  // of where it is positive; null: not known
};
// Throws std::invalid_argument for others, that `what`, such as "Offset takes", solids of one wall.
Single SingleOf(const NodePtr& tree, const std::string& what);

}  // namespace stellate::solids
