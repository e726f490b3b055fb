#pragma once

#include <vector>

#include "core/complex/stars.h"
#include "core/report.h"

namespace stellate::core {

// Returns the meshes of all faces of a manifold with boundary, by dimension, the lowest first.
template <int K>
std::vector<FaceMesh> FacesOf(const Stars<K>& stars);

}  // namespace stellate::core
