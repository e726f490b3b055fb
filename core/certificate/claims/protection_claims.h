#pragma once

#include "core/certificate/claims/examination.h"

namespace stellate::core {

// Measures how well a mesh is protected, where that was asked for, and warns where it is less than
// was asked; with a reach that the mesh was proved from, whether its Delaunay complexes are the
// mesh. Call it after all other claims. No certificate is refused for it.
void JudgeProtection(Examination& x);

}  // namespace stellate::core
