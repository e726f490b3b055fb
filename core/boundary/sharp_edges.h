#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/stars.h"
#include "core/report.h"

namespace stellate::core {

// Edges where walls meet at small angles. Refining one wall there encroaches on the other and back,
// without end, unless the edge between them has protecting balls.

struct WallCosine {
  WallSet walls = 0;  // two
  double cosine = 0;  // of the angle between them inside M
};

// Returns the two walls at a point that meet at the smallest angle, by their conormals; nothing if
// it is on fewer than two walls.
template <int K>
std::optional<WallCosine> SharpestAt(const Stars<K>& stars, std::uint32_t p);

// Returns the smallest angle at all points, as reports have it.
template <int K>
std::optional<WallAngle> Sharpest(const Stars<K>& stars);

// The refinement was seen to end from this angle on, degrees, in dimension 3 with protecting balls.
// If it does not end, messages name the angles below.
inline constexpr double SafeAngle(int k) { return k <= 2 ? 15 : k == 3 ? 22 : 55; }
// Below this angle messages warn that simplices are as thin.
inline constexpr double ThinAngle(int k) { return k <= 2 ? 15 : 55; }

}  // namespace stellate::core
