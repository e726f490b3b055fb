#pragma once

#include "core/base/vector_ops.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// |the part of `step` along the tangent space at v|^2; `step`: d.
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
