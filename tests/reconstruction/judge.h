#pragma once

#include <cstdint>
#include <vector>

#include "tests/reconstruction/samples.h"

namespace stellate::testing {

// What a complex is, counted from its simplices alone by code that the core has no part in.
struct Counted {
  std::uint64_t simplices = 0;
  bool well_formed = true;       // ids ascending and below the number of vertices, no simplex twice
  std::uint64_t bad_facets = 0;  // not in two simplices
  std::uint64_t rim_facets = 0;  // of these, in one
  std::uint64_t bad_links = 0;   // vertices whose link is no sphere; k <= 3
  std::int64_t euler = 0;
  int components = 0;
  bool orientable = true;  // means something where bad_facets is 0

  bool IsClosedManifold() const {
    return simplices > 0 && well_formed && bad_facets == 0 && bad_links == 0;
  }
};

Counted Count(int k, const std::vector<std::uint32_t>& simplices, std::uint32_t vertices);

// Whether it is a closed manifold with the topology of the sample's.
bool IsRight(const Counted& counted, const Sample& sample);

// Whether GUDHI finds the homology mod 2 of the sample's manifold in simplices of its dimension.
bool HasHomologyOf(const Sample& sample, const std::vector<std::uint32_t>& simplices);

}  // namespace stellate::testing
