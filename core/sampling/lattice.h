#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

namespace stellate::core {

// The lattice A_k^* (hexagonal for k = 2, body-centred cubic for k = 3), the thinnest covering of
// R^k among lattices for k <= 5 (Conway and Sloane, Sphere Packings, Lattices and Groups, Ch. 2).

// Returns its nearest-neighbour distance for a covering radius of 1.
inline double LatticeSpacing(int k) { return std::sqrt(12.0 / (k + 2)); }

// The vectors to the lattice points whose Voronoi cells share a facet with that of the origin,
// 2^(k+1) - 2 of them, k numbers each, in units of the nearest-neighbour distance.
std::vector<double> LatticeVectors(int k);

// The length of the longest of them.
inline double LongestLatticeVector(int k) {
  const int half = (k + 1) / 2, other_half = (k + 2) / 2;
  return std::sqrt(static_cast<double>(half * other_half) / k);
}

// Names points of the lattice, so that neighbours mostly have consecutive names: the interleaved
// bits of their k coordinates by k basis vectors. Far away, names recur.
class LatticeNames {
 public:
  explicit LatticeNames(int k);

  // Returns the name to begin with: steps of equal number are possible from it in all directions.
  std::uint64_t origin() const { return origin_; }
  // Returns the name of the neighbour by the i-th of the vectors above.
  std::uint64_t Neighbour(std::uint64_t name, std::size_t i) const {
    std::uint64_t neighbour = 0;
    for (const std::uint64_t bits : coordinates_)
      neighbour |= ((name | ~bits) + (steps_[i] & bits)) & bits;
    return neighbour;
  }

 private:
  std::vector<std::uint64_t> coordinates_;  // which bits are whose
  std::vector<std::uint64_t> steps_;        // by vector
  std::uint64_t origin_ = 0;
};

}  // namespace stellate::core
