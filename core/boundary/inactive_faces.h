#pragma once

#include "core/complex/stars.h"

namespace stellate::core {

// Whether a sample point is on all walls of a face. Without one the face is inactive.
template <int K>
bool HasPointOn(const Stars<K>& stars, WallSet face) {
  for (const std::uint32_t p : stars.sample().boundary())
    if (IsSubset(face, stars.sample().walls(p))) return true;
  return false;
}

}  // namespace stellate::core
