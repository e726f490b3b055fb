#pragma once

#include "core/base/vector_ops.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// Returns the squared length of the projection of `step` (d) on the tangent space at v.
inline double SquaredAlong(const MeshView& mesh, std::uint32_t v, const double* step) {
  const double* tangent = mesh.Tangent(v);
  double along2 = 0;
  for (int a = 0; a < mesh.k; ++a, tangent += mesh.d) {
    const double along = Dot(tangent, step, mesh.d);
    along2 += along * along;
  }
  return along2;
}

}  // namespace stellate::core
