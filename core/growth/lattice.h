#pragma once

#include <cmath>
#include <vector>

namespace stellate::core {

// The lattice A_k^* (hexagonal for k = 2, body-centred cubic for k = 3), the thinnest covering of
// R^k among lattices for k <= 5 (Conway and Sloane, Sphere Packings, Lattices and Groups, Ch. 2).

// Its nearest-neighbour distance where the covering radius is 1.
inline double LatticeSpacing(int k) { return std::sqrt(12.0 / (k + 2)); }

// The vectors to the lattice points whose Voronoi cells share a facet with that of the origin,
// 2^(k+1) - 2 of them, k numbers each, in units of the nearest-neighbour distance.
std::vector<double> LatticeVectors(int k);

// The length of the longest of them.
inline double LongestLatticeVector(int k) {
  const int half = (k + 1) / 2, other_half = (k + 2) / 2;
  return std::sqrt(static_cast<double>(half * other_half) / k);
}

}  // namespace stellate::core
