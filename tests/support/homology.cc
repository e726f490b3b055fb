#include "support/homology.h"

// GUDHI prints to std::cout without including it.
// clang-format off
#include <iostream>
#include <gudhi/Persistent_cohomology.h>
#include <gudhi/Simplex_tree.h>
// clang-format on

namespace stellate::testing {

std::vector<int> BettiNumbers(const std::vector<Facet>& facets, int prime) {
  // The default options take any vertex ids; the faster ones want 0, 1, 2, ... without a gap.
  using Tree = Gudhi::Simplex_tree<>;
  using Cohomology =
      Gudhi::persistent_cohomology::Persistent_cohomology<Tree,
                                                          Gudhi::persistent_cohomology::Field_Zp>;
  if (facets.empty()) return {};
  Tree tree;
  for (const Facet& facet : facets) tree.insert_simplex_and_subfaces(facet, 0.0);
  // Without `true` the classes of the top dimension are left out.
  Cohomology cohomology(tree, true);
  cohomology.init_coefficients(prime);
  cohomology.compute_persistent_cohomology(0.0);
  std::vector<int> betti = cohomology.betti_numbers();
  betti.resize(facets.front().size(), 0);
  return betti;
}

}  // namespace stellate::testing
