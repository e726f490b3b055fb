#include "core/refinement/filled_mesh.h"

#include <algorithm>

#include "core/complex/consistency.h"
#include "core/refinement/exchange.h"

namespace stellate::core {
namespace {

// Cavities are filled from this k on: below, good points resolve the few inconsistencies.
constexpr int kFirstFilled = 4;

}  // namespace

template <int K>
void FilledMesh<K>::Fill(const Stars<K>& stars, const ResolvedCriteria& criteria) {
  Clear();
  if (K < kFirstFilled || criteria.centre_rule != CentreRule::kCommonCentre) return;
  cavities_ = FillCavities<K>(
      stars, {criteria.epsilon, criteria.radius_edge_bound, criteria.shape.sliver_bound});
}

template <int K>
bool FilledMesh<K>::Resolves(const Stars<K>& stars, std::uint32_t star,
                             const Violation<K>& violation) const {
  if (cavities_.cavities == 0 || violation.fake || violation.walls != 0 ||
      std::binary_search(cavities_.unfilled.begin(), cavities_.unfilled.end(), star))
    return false;
  return violation.rule == Rule::kInconsistent ||
         !IsConsistent<K>(stars, star, violation.vertex, violation.sector);
}

template <int K>
void FilledMesh<K>::HandOut(const Stars<K>& stars, std::vector<std::uint32_t>* added,
                            std::vector<std::uint32_t>* removed) {
  ExchangeSimplices<K>(stars.Simplices(), cavities_.simplices, added, removed);
  is_handed_out_ = true;
}

STELLATE_INSTANTIATE_CLASS(FilledMesh)

}  // namespace stellate::core
