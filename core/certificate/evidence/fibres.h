#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/certificate/complex/topology.h"
#include "core/certificate/mesh_view.h"
#include "core/specification.h"

namespace stellate::core {

// How a mesh meets the normal flats (fibres) of M. If each fibre meets it exactly once nearby, the
// mesh covers M exactly once along its normals: nothing is missing, doubled or bridged.
//
// The points of M in question are few and the mesh is large: each call takes all points and goes
// through the mesh once, in parallel.

// The mesh vertex nearest to a point, the one of lowest id if there are several, and its distance.
struct NearestVertex {
  std::uint32_t vertex = 0;
  double distance = 0;
};
// `points`: d each, C order. `near`: a length within which most have a vertex.
std::vector<NearestVertex> FindNearestVertices(const MeshView& mesh,
                                               const std::vector<double>& points, double near);

// The flat x + T^perp.
struct Fibre {
  const double* x;        // d
  const double* tangent;  // k x d, C order, orthonormal rows
  double reach_out;       // length
  std::uint64_t random_key;
};

// The points where a fibre meets the mesh within reach_out of x.
struct FibreHits {
  int count = 0;              // of points; -1: rounding would decide
  double distance = 0;        // of the farthest from x
  std::uint32_t simplex = 0;  // that it is in
};
// Returns the hits of each fibre. If a flat passes so close to the boundary of a simplex that
// rounding would decide, parallel flats, at most kSideStep reach_out to the side, are tried.
// `max_diameter`: of the mesh's simplices.
inline constexpr double kSideStep = 0.02;
std::vector<FibreHits> CountHits(const MeshView& mesh, const VertexStars& stars,
                                 double max_diameter, const std::vector<Fibre>& fibres);

}  // namespace stellate::core
