#pragma once

namespace stellate::core {

// Of a point y of M, whose squared distance from another point p of it is `distance2`, and which is
// `away` from M's tangent space there: the reach is at most |y - p|^2 / (2 dist(y, T_pM)) (Federer,
// Curvature measures, Theorem 4.18). All lengths.
inline double ReachBound(double distance2, double away) { return distance2 / (2 * away); }

// Whether y, `distance` from p and `away` from T_pM, tells of the reach at p, where the mesh has
// edges up to `longest_edge`. Far ones do. Near ones do where they lie so steeply above T_pM that
// no error of the tangent space that lets a mesh be made explains it, and farther than the oracle's
// own error may have moved them.
inline bool IsTelling(double distance, double away, double longest_edge, double position_error) {
  constexpr double kFar = 0.5, kSteep = 0.25, kErrors = 10;
  if (!(distance > kErrors * position_error)) return false;
  return distance >= kFar * longest_edge || away >= kSteep * distance;
}

}  // namespace stellate::core
