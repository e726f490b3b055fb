#pragma once

#include <cstdint>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/reconstruction/assembly.h"
#include "core/reconstruction/fitted_cloud.h"
#include "core/report.h"

namespace stellate::core {

// The boundary of a mesh that ends where stars are open, as the certificate knows boundaries: all
// of it is the face of one wall.
struct OpenBoundary {
  std::vector<WallSet> walls;   // by vertex, 1 on the boundary
  std::vector<double> outward;  // by vertex, k tangent coordinates: away from the star's simplices
  std::vector<FaceMesh> faces;  // one; none if the mesh is closed
};

// Finds the facets that are in one simplex alone. `mesh`: without boundary as yet.
OpenBoundary FindOpenBoundary(const MeshView& mesh);

// Removes the simplices that reach over an open place: those of a circumradius as of open stars,
// and then, where a vertex is left with several fans of triangles, all fans but the largest.
void TrimBoundary(const FittedCloud& cloud, Assembly* assembly);

}  // namespace stellate::core
