#pragma once

#include "core/certificate/claims/examination.h"
#include "core/certificate/measure/star_geometry.h"

namespace stellate::core {

// Decides without a query, on the whole mesh: it is a closed complex whose links are spheres, its
// stars embed, its simplices are so large and of such shapes. Sets stars, shape, longest_edge and
// size of the examination. Returns nothing if the list of simplices is no complex, so that no claim
// can be examined.
std::optional<StarGeometry> JudgeComplex(Examination& examination);

}  // namespace stellate::core
