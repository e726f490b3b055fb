#pragma once

#include <cstdint>
#include <vector>

#include "core/certificate/mesh_view.h"
#include "core/certificate/topology.h"

namespace stellate::core {

// Extremes of the shapes of a mesh's k-simplices.
struct MeshShape {
  double max_circumradius = 0;  // of a k-simplex, length
  std::uint32_t largest = 0;    // the simplex that has it
  double max_diameter = 0;      // length
  double max_radius_edge = 0;
  double min_fatness = 1;
  double min_angle_degrees = 0;  // k = 2; else 0
  double max_tangent_angle_degrees = 0;

  std::vector<float> diameters;  // by simplex, length
  std::vector<float> tilts;      // by simplex: largest sum of squared sines to a vertex's tangents
};

// Time linear in the mesh; O(d k^2) a simplex.
MeshShape MeasureShape(const MeshView& mesh, const SimplexList& list);

}  // namespace stellate::core
