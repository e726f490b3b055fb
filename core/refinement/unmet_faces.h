#pragma once

#include "core/complex/star_complex.h"

namespace stellate::core {

// Whether a sample point is on all walls of a face. Without one the face is inactive.
template <int K>
bool HasPointOn(const StarComplex<K>& complex, WallSet face) {
  for (std::uint32_t p = 0; p < complex.size(); ++p)
    if (IsSubset(face, complex.walls(p))) return true;
  return false;
}

}  // namespace stellate::core
