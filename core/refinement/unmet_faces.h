#pragma once

#include "core/complex/star_complex.h"

namespace stellate::core {

// Whether some point of the sample is on all walls of a face.
template <int K>
bool HasPointOn(const StarComplex<K>& complex, WallSet face) {
  for (std::uint32_t p = 0; p < complex.size(); ++p)
    if (IsSubset(face, complex.walls(p))) return true;
  return false;
}

}  // namespace stellate::core
