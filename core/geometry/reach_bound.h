#pragma once

namespace stellate::core {

// Returns the bound of the reach by two points y and p of M: |y - p|^2 / (2 dist(y, T_pM))
// (Federer, Curvature measures, Theorem 4.18). `distance2`: |y - p|^2; `away`: dist(y, T_pM);
// lengths.
inline double ReachBound(double distance2, double away) { return distance2 / (2 * away); }

// Whether y, at `distance` from p and `away` from T_pM, bounds the reach at p, where the mesh has
// edges up to `longest_edge`. Far points do. Near points do if they lie so steeply above T_pM that
// no error of the tangent space explains it with which a mesh could be made, and are farther away
// than the oracle's own error may have moved them.
inline bool IsTelling(double distance, double away, double longest_edge, double position_error) {
  constexpr double kFar = 0.5, kSteep = 0.25, kErrors = 10;
  if (!(distance > kErrors * position_error)) return false;
  return distance >= kFar * longest_edge || away >= kSteep * distance;
}

}  // namespace stellate::core
