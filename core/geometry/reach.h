#pragma once

namespace stellate::core {

// Bounds from a lower bound r of the reach of a manifold M, for a simplex with vertices on M whose
// smallest enclosing ball has the radius rho. All are lengths or radians, and monotone in rho.

// Returns the largest distance of a point of the simplex from M: r - sqrt(r^2 - rho^2) (Attali,
// Lieutier, Salinas: Vietoris-Rips complexes also provide topologically correct reconstructions of
// sampled shapes). Infinity for rho >= reach, where nothing is known.
double LargestDistance(double rho, double reach);

// Returns the largest angle by which M's tangent space turns between the vertex nearest to a point
// of the simplex and that point's closest point on M: 2 asin((rho + LargestDistance) / 2r)
// (Boissonnat, Lieutier, Wintraecken: The reach, metric distortion, geodesic convexity and the
// variation of tangent spaces). Infinity where nothing is known.
double LargestTurn(double rho, double reach);
// Returns the sine of half of it, the same on every processor; 1 or more: nothing is known.
double SineOfHalfTurn(double rho, double reach);

// Returns the largest rho with LargestTurn <= turn; turn in [0, pi / 2].
double RadiusThatTurns(double turn, double reach);
// Returns the same by the sine of half the turn.
double RadiusOfHalfTurn(double sine, double reach);

// Returns the largest radius of a k-simplex's smallest enclosing ball, as a share of its diameter
// (Jung).
double JungRatio(int k);

}  // namespace stellate::core
