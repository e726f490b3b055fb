#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/star_complex.h"
#include "core/report.h"

namespace stellate::core {

// Where walls meet at small angles. There the refinement of one wall encroaches on the other and
// that on the first, without end, unless the edge between them is guarded.

struct WallCosine {
  WallSet walls = 0;  // two
  double cosine = 0;  // of the angle at which they meet inside of M
};

// The two walls at a point that meet at the smallest angle, by their conormals. Nothing where it is
// on fewer than two.
template <int K>
std::optional<WallCosine> SharpestAt(const StarComplex<K>& complex, std::uint32_t p);

// The same of all points, as reports have it.
template <int K>
std::optional<WallAngle> Sharpest(const StarComplex<K>& complex);

// From this angle on, degrees, the refinement was seen to end, in dimension 3 by guards: if it does
// not, any below are told by name.
inline constexpr double SafeAngle(int k) { return k <= 2 ? 15 : k == 3 ? 22 : 55; }
// Below this angle simplices are told to be as thin.
inline constexpr double ThinAngle(int k) { return k <= 2 ? 15 : 55; }

}  // namespace stellate::core
