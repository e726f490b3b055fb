#pragma once

namespace stellate::core {

// One centre for a k-simplex, the same for the stars of all its vertices: a point equidistant from
// them and, to third order, on M. Stars that judge a simplex at this centre, instead of each at the
// circumcentre in its own tangent space, rarely disagree.
//
// With x the circumcentre of sigma in its affine hull, b its barycentric coordinates and P_i the
// projection on the tangent space at v_i:
//
//   c = x + N ( sum_i b_i P_i (x - v_i) / 2 ),   N the projection on the normal space of sigma.
//
// For simplices that are large compared with the reach, as all are for k >= 4 at any affordable
// size, P_i (x - v_i) / 2 is turned with the tangent spaces from v_i to their mean. This is exact
// on spheres and on products of circles, where c leaves M by 0.07 % of the circumradius instead of
// 4 % (T^4 in R^8 at epsilon = 0.8 reach, median).
//
// The weights perturb it: c has the same power |c - v_i|^2 - weight_i to all vertices.
//
//   points    K+1 points of R^d, in an order that all stars share
//   tangents  K rows of d for each, orthonormal
//   weights   K+1, length squared
//   most2     the largest square that sigma's circumradius in its hull may have
//   centre    d, relative to points[0]
//
// Returns false, with `centre` undefined, if sigma is larger, or flat to rounding. Cost O(d K^2).
template <int K>
bool CommonCentre(int d, const double* const* points, const double* const* tangents,
                  const double* weights, double most2, double* centre);

}  // namespace stellate::core
