#pragma once

#include <cstdint>
#include <string>

#include "core/certificate/complex/topology.h"
#include "core/certificate/measure/shape.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// What a finished mesh proves about a manifold M if one number is known: a lower bound r of M's
// reach. Everything else is measured on the mesh; docs/using/proof.md has the theorem and its
// proof. With, for a k-simplex s of the mesh,
//
//   rho(s)    a bound of the radius of its smallest enclosing ball, length
//   h(s)      = r - sqrt(r^2 - rho^2): no point of s is farther from M (Attali, Lieutier, Salinas)
//   theta(s)  = 2 asin((rho + h) / 2r): M turns by no more between the vertex of s nearest to a
//             point of s and that point's closest point (Boissonnat, Lieutier, Wintraecken)
//   alpha(s)  the largest angle between s and the tangent space at one of its vertices
//
// the mesh is isotopic to the components of M that it meets, and within max h of them, if it is
// closed, each star embeds in the tangent space of its centre, and
//
//   (A) alpha(s) + tangent_error + theta(s) < pi / 2 for each s,
//   (B) each component has a vertex p from which every simplex s that does not hold p is farther
//       than h(s).
struct ReachClaim {
  double reach = 0;          // r, length
  double tangent_error = 0;  // radians: between the mesh's tangent bases and M's tangent spaces
};

// Whether two points p and q of M contradict the claim: |q - p| = `length`, and q is `away` from
// M's tangent space at p, at most length^2 / 2r by Federer. They do if `away` is more, even if the
// claim's tangents are wrong by tangent_error and positions by `noise`.
bool Contradicts(const ReachClaim& claim, double length, double away, double noise);
// Returns how much of `away` wrong tangents (the claim's tangent_error) and positions wrong by
// `noise` may explain.
double Blame(const ReachClaim& claim, double length, double noise);

struct Proof {
  bool holds = false;
  double distance = 0;   // max h: a bound of the Hausdorff distance, length
  std::string obstacle;  // plain words: what (A) or (B) fails for, and what would do; else empty
};

// Decides (A) and (B). REQUIRES: the mesh is closed and its stars embed. Time linear in the mesh.
Proof ProveFromReach(const MeshView& mesh, const VertexStars& stars, const MeshShape& shape,
                     const ReachClaim& claim);

}  // namespace stellate::core
