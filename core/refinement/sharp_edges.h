#pragma once

#include <cstdint>
#include <optional>

#include "core/complex/star_complex.h"
#include "core/report.h"

namespace stellate::core {

// Where walls meet at small angles. There the refinement of one wall encroaches on the other and
// that on the first, without end, unless the edge between them is guarded.

// The two walls at a point that meet at the smallest angle inside of M, by their conormals. Nothing
// where it is on fewer than two. `point` is left empty.
template <int K>
std::optional<WallAngle> SharpestAt(const StarComplex<K>& complex, std::uint32_t p);

// The same of all points.
template <int K>
std::optional<WallAngle> Sharpest(const StarComplex<K>& complex);

// From this angle on, degrees, the refinement was seen to end: any below are told by name.
inline constexpr double SafeAngle(int k) { return k <= 2 ? 15 : 55; }

}  // namespace stellate::core
