#pragma once

#include <string>

#include "core/base/message.h"
#include "core/walls.h"

namespace stellate::core {

// Writes the walls of a set for people, ascending.
//
//   ListWalls(SetOfWall(0) | SetOfWall(2));  // "0, 2"
inline std::string ListWalls(WallSet walls) {
  std::string names;
  ForEachWall(walls, [&](int wall) { names += Message(names.empty() ? "" : ", ", wall); });
  return names;
}

}  // namespace stellate::core
