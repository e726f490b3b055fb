#pragma once

#include "core/certificate/claims/examination.h"
#include "core/certificate/measure/star_geometry.h"

namespace stellate::core {

// What is decided on the whole mesh, without a question: that it is a closed complex whose links
// are spheres, that its stars embed, how large and well shaped its simplices are. Sets stars,
// shape, longest_edge and size. Nothing, if it is no complex and nothing can be asked of it.
std::optional<StarGeometry> JudgeComplex(Examination& examination);

}  // namespace stellate::core
