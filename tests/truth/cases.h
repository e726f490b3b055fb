#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/truth/shapes.h"

namespace stellate::truth {

// A mesh to be asked for.
struct Case {
  std::string family;
  ShapePtr shape;
  double epsilon = 0;
  double hole = 0;        // its radius, where there is one: a boundary, and the reach with it
  bool tangents = false;  // the oracle gives them
  bool seeds = false;     // one on each component; else the box alone
  double box = 1.2;       // half its side, in radii of the shape
};

// The families; all but the last are made to deceive.
const std::vector<std::string>& Families();
// The n-th case of a family: a function of both and of `seed` alone.
Case MakeCase(const std::string& family, std::uint64_t seed, std::uint64_t n);

// What no question can see: families whose wrong meshes are counted apart.
bool IsBeyondSeeing(const std::string& family);

}  // namespace stellate::truth
