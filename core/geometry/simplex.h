#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

namespace stellate::core {

// Measures of a j-simplex in R^d, 0 <= j <= kMaxSimplexDimension, any d >= 1.
//
// A simplex is given by pointers to its j + 1 vertices, d coordinates each; their order does not
// matter. Results do not change under isometries of R^d, and scale as their units say, both to
// rounding: relative errors are about 1e-15 diam / height, heights being those of the simplex.
// Degenerate simplices are well defined: volume 0, circumradius infinite.
// Cost O(d j^2), once. Pure; any thread.
//
// Source: thesis, Section 2.3 (fatness, slivers) and Section 5.3.3.

// k + 1 for the largest k: the dimension of an inconsistent configuration.
inline constexpr int kMaxSimplexDimension = 6;

using SimplexVertices = std::span<const double* const>;

struct SimplexMeasures {
  int dimension = 0;         // j
  double volume = 1;         // vol_j, length^j; 1 for a vertex
  double diameter = 0;       // the longest edge, length
  double shortest_edge = 0;  // length
  double circumradius = 0;   // of the smallest circumscribing ball; infinity if there is none

  // rho = circumradius / shortest edge, no unit; infinity when degenerate. 0 for a vertex.
  double RadiusEdgeRatio() const;
  // Theta = vol_j / diam^j, no unit; 1 for a vertex or an edge, 0 when degenerate.
  double Fatness() const;
};

SimplexMeasures MeasureSimplex(SimplexVertices vertices, int d);

// Theta(sigma) >= theta0^j.
bool IsFat(SimplexVertices vertices, int d, double theta0);

// A Theta0-sliver: j >= 2, Theta(sigma) < theta0^j, and every proper face is Theta0-fat.
bool IsSliver(SimplexVertices vertices, int d, double theta0);

// Whether the simplex or one of its faces is a Theta0-sliver. For distinct vertices this means that
// some face of dimension 2 or more is not Theta0-fat: the smallest such face is a sliver.
bool ContainsSliver(SimplexVertices vertices, int d, double theta0);

// An orthonormal frame of a simplex's affine hull, and its edges in it. The edge farthest from the
// span of those before it is taken next, and each residual is computed from residuals, so that
// heights are right to rounding where a Gram determinant would lose half of the digits.
struct SimplexFrame {
  int rank = 0;                                        // j, or less when degenerate
  std::vector<double> directions;                      // j x d, C order: `rank` orthonormal rows
  std::array<double, kMaxSimplexDimension> heights{};  // of each vertex over those before, length
  // [a]: the edge from the first vertex to the a-th taken, along the first a + 1 directions.
  std::array<std::array<double, kMaxSimplexDimension>, kMaxSimplexDimension> edges{};
};
SimplexFrame FrameSimplex(SimplexVertices vertices, int d);

// Measures a simplex whose frame is known.
SimplexMeasures MeasureSimplex(SimplexVertices vertices, int d, const SimplexFrame& frame);

// Largest angle, radians in [0, pi/2], that a direction of the simplex's affine hull makes with
// the space spanned by `tangent`: k x d in C order, orthonormal rows, j <= k. Right angle for
// a degenerate simplex; 0 for a vertex.
double AngleToTangent(SimplexVertices vertices, int d, const double* tangent, int k);
double AngleToTangent(const SimplexFrame& frame, int j, int d, const double* tangent, int k);
// Its sine, the same on every processor.
double SineToTangent(const SimplexFrame& frame, int j, int d, const double* tangent, int k);

// I - (T^t Q)^t (T^t Q) in its upper left j x j block, Q being the frame's directions: its
// eigenvalues are the squared sines of the principal angles, to about 1e-15. A cheap way to decide
// that a simplex is tilted less than some angle; AngleToTangent resolves small angles better.
// REQUIRES: frame.rank == j.
using TiltMatrix = Eigen::Matrix<double, kMaxSimplexDimension, kMaxSimplexDimension>;
TiltMatrix MeasureTilt(const SimplexFrame& frame, int j, int d, const double* tangent, int k);

// Smallest angle of a triangle, radians; 0 when degenerate.
double SmallestTriangleAngle(SimplexVertices vertices, int d);

}  // namespace stellate::core
