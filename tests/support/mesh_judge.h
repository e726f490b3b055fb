#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "stellate/catalogue.h"
#include "stellate/mesh.h"

namespace stellate::testing {

// What a complex is, found from its simplices alone. Shares no code with the mesher.
struct Judgement {
  bool valid = true;                  // ids in range, ascending and distinct, no simplex twice
  std::uint64_t unused_vertices = 0;  // in no simplex
  std::uint64_t bad_faces = 0;        // (k-1)-faces that are not in exactly two simplices
  std::uint64_t bad_links = 0;  // vertices whose link is no (k-1)-sphere: exact for k <= 3, above
                                // a homology manifold with a sphere's homology
  int components = 0;
  std::int64_t euler_characteristic = 0;
  bool orientable = false;  // by homology over Z/3; means something when bad_faces is 0
  std::vector<int> betti_mod2, betti_mod3;

  bool IsClosedManifold() const {
    return valid && unused_vertices == 0 && bad_faces == 0 && bad_links == 0;
  }
};

Judgement Judge(const SimplexMatrix& simplices, std::uint64_t vertices);

// Certified by its report, and by Judge a closed manifold with the homology of `manifold`; its
// vertices on the manifold and its barycentres within `epsilon` of it; the report's topology the
// one that Judge sees.
::testing::AssertionResult IsFaithful(const Mesh& mesh, Manifold& manifold, double epsilon);

}  // namespace stellate::testing
