#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace stellate::core {

// How the simplices of a mesh are turned to agree with their neighbours. Two simplices with
// ascending ids agree if they induce opposite orientations on the facet they share, where the facet
// opposite the i-th id has the sign (-1)^i.
struct Orientation {
  // False, and nothing is turned, if not all can agree, or if a facet is in three simplices.
  bool orientable = false;
  // By simplex, s in bit s % 8 of byte s / 8: whether its last two ids have to be exchanged.
  std::vector<std::uint8_t> turned;

  bool operator==(const Orientation&) const = default;
};

// Orients the simplices of a mesh, whole or not. In each component, which hangs together by facets,
// the first simplex stays as it is; but a hypersurface (d = k + 1) has its normals outwards, as the
// sum of det(p_0, ..., p_k) over each component says, and simplices that fill space (d = k) have
// positive volumes. Takes about 8 (k + 2) bytes a simplex.
//
// k, d       of the mesh
// vertices   their number
// simplices  k + 1 ascending ids each, in lexicographic order; what is no such list is not
// orientable point      the d coordinates of a vertex; any thread calls it
Orientation Orient(int k, int d, std::uint32_t vertices,
                   const std::vector<std::uint32_t>& simplices,
                   const std::function<const double*(std::uint32_t)>& point);

}  // namespace stellate::core
