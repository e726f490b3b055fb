#pragma once

namespace stellate::core {

// What a lower bound r of the reach of a manifold M says of a simplex with its vertices on M, whose
// smallest enclosing ball has the radius rho. All are lengths or radians, monotone in rho.

// No point of the simplex is farther from M: r - sqrt(r^2 - rho^2) (Attali, Lieutier, Salinas:
// Vietoris-Rips complexes also provide topologically correct reconstructions of sampled shapes).
// Infinity for rho >= reach, where nothing is known.
double LargestDistance(double rho, double reach);

// M's tangent space turns by no more between the vertex nearest to a point of the simplex and that
// point's closest point on M: 2 asin((rho + LargestDistance) / 2r) (Boissonnat, Lieutier,
// Wintraecken: The reach, metric distortion, geodesic convexity and the variation of tangent
// spaces). Infinity where nothing is known.
double LargestTurn(double rho, double reach);
// The sine of half of it, the same on every processor; no less than 1: nothing is known.
double SineOfHalfTurn(double rho, double reach);

// The largest rho with LargestTurn <= turn; turn in [0, pi / 2].
double RadiusThatTurns(double turn, double reach);
// By the sine of half the turn.
double RadiusOfHalfTurn(double sine, double reach);

// No k-simplex needs an enclosing ball of a radius beyond this share of its diameter (Jung).
double JungRatio(int k);

}  // namespace stellate::core
