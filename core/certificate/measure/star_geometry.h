#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/certificate/complex/topology.h"
#include "core/certificate/measure/shape.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// How the stars look in the tangent spaces of their centres, and the shapes of their simplices.
struct StarGeometry {
  // Stars whose projection on the tangent space of their centre is not an embedding. Consistency
  // alone does not exclude them with CentreRule::kCommonCentre.
  std::uint64_t unembedded_stars = 0;
  std::string first_unembedded;                // plain words; empty if none
  std::vector<std::uint32_t> some_unembedded;  // the first Violations::kMost of their centres

  // The smallest |q - p|^2 / (2 dist(q, T_pM)) over mesh edges: an upper bound of the reach
  // (Federer). Infinity for a flat mesh.
  double reach = 0;
  std::uint32_t narrowest_p = 0, narrowest_q = 0;  // where it is attained

  std::vector<double> longest_edge;  // by vertex, length
  MeshShape shape;
};

// Measures all stars. A star embeds if simplices that share a facet through its centre p lie on
// opposite sides of it in T_pM, and one generic ray from p meets exactly one simplex: the first
// makes the radial projection of the link a covering of the sphere of directions, the second makes
// it one-sheeted. `orientation`: of a closed mesh, as in Connectivity, makes the first test faster;
// empty if there is none. Time linear in the mesh.
StarGeometry MeasureStars(const MeshView& mesh, const Adjacency& adjacency,
                          std::span<const std::int8_t> orientation = {});

// A closed manifold whose stars embed.
struct EmbeddedStars {
  StarGeometry geometry;
  Connectivity connectivity;  // without its orientation
  std::int64_t euler_characteristic = 0;
};

// Decides without an adjacency whether the complex is a closed manifold whose stars embed: each
// star decides for the facets and the link of its centre. Returns nothing if it is not, or if stars
// alone do not decide: for k > 3, for manifolds with boundary, and for very large stars.
// MeasureStars then says what is wrong. Time linear in the mesh.
std::optional<EmbeddedStars> MeasureIfEmbedded(const MeshView& mesh, const VertexStars& stars);

}  // namespace stellate::core
