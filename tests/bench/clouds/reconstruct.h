#pragma once

#include <cstdint>
#include <vector>

#include "tests/reconstruction/samples.h"

namespace stellate::bench {

// What a program makes of a sample.
struct Reconstructed {
  bool applies = true;                   // the program takes samples of these dimensions
  std::uint32_t vertices = 0;            // of the mesh
  std::vector<std::uint32_t> simplices;  // k + 1 vertex numbers each, ascending
  bool certified = false;                // what the program itself says; of ours alone
  double seconds = 0;                    // of the processor
};

using Reconstruct = Reconstructed (*)(const testing::Sample& sample);

// stellate::core::Reconstruct, tangent spaces estimated.
Reconstructed ReconstructWithStellate(const testing::Sample& sample);
// CGAL's advancing front: surfaces in R^3, at the given points.
Reconstructed ReconstructWithFront(const testing::Sample& sample);
// CGAL's Poisson reconstruction: surfaces in R^3, at new points, from normals that it estimates.
Reconstructed ReconstructWithPoisson(const testing::Sample& sample);
// GUDHI's tangential complex, tangent spaces estimated, and at most 20 seconds of its repair.
Reconstructed ReconstructWithTangential(const testing::Sample& sample);

}  // namespace stellate::bench
