#include "core/refinement/filled_mesh.h"

#include <algorithm>
#include <functional>
#include <iterator>

#include "core/base/parallel.h"
#include "core/complex/consistency.h"

namespace stellate::core {
namespace {

// Where cavities are filled: below, good points mend the few stars that disagree.
constexpr int kFirstFilled = 4;

template <int K>
using Simplices = std::vector<typename StarComplex<K>::Simplex>;

template <int K>
Simplices<K> Sorted(const std::vector<std::uint32_t>& ids) {
  Simplices<K> simplices(ids.size() / (K + 1));
  ParallelFor(simplices.size(), [&](std::size_t i) {
    std::copy_n(ids.data() + i * (K + 1), K + 1, simplices[i].begin());
  });
  ParallelSort(simplices, std::less<>());
  return simplices;
}

template <int K>
Simplices<K> Difference(const Simplices<K>& a, const Simplices<K>& b) {
  Simplices<K> difference;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(difference));
  return difference;
}

// a - b + c, where c is disjoint from what is left of a.
template <int K>
std::vector<std::uint32_t> Exchange(const Simplices<K>& a, const Simplices<K>& b,
                                    const Simplices<K>& c) {
  Simplices<K> all = Difference<K>(a, b);
  all.insert(all.end(), c.begin(), c.end());
  ParallelSort(all, std::less<>());
  std::vector<std::uint32_t> ids;
  ids.reserve(all.size() * (K + 1));
  for (const auto& simplex : all) ids.insert(ids.end(), simplex.begin(), simplex.end());
  return ids;
}

}  // namespace

template <int K>
void FilledMesh<K>::Fill(const StarComplex<K>& complex, const ResolvedCriteria& criteria) {
  Clear();
  if (K < kFirstFilled || criteria.judging != Judging::kCommonCentre) return;
  cavities_ = FillCavities<K>(
      complex, {criteria.epsilon, criteria.radius_edge_bound, criteria.shape.sliver_bound});
}

template <int K>
bool FilledMesh<K>::Mends(const StarComplex<K>& complex, std::uint32_t star,
                          const Violation<K>& violation) const {
  if (cavities_.cavities == 0 || violation.fake ||
      std::binary_search(cavities_.unfilled.begin(), cavities_.unfilled.end(), star))
    return false;
  return violation.rule == Rule::kInconsistent || !IsConsistent<K>(complex, star, violation.vertex);
}

template <int K>
void FilledMesh<K>::HandOut(const StarComplex<K>& complex, std::vector<std::uint32_t>* added,
                            std::vector<std::uint32_t>* removed) {
  const Simplices<K> before = Sorted<K>(complex.Simplices()),
                     after = Sorted<K>(cavities_.simplices);
  const Simplices<K> lost = Difference<K>(before, after), won = Difference<K>(after, before);
  const Simplices<K> added_before = Sorted<K>(*added), removed_before = Sorted<K>(*removed);
  const Simplices<K> won_now = Difference<K>(won, removed_before),
                     lost_now = Difference<K>(lost, added_before);
  *added = Exchange<K>(added_before, lost, won_now);
  *removed = Exchange<K>(removed_before, won, lost_now);
  is_handed_out_ = true;
}

STELLATE_INSTANTIATE_CLASS(FilledMesh)

}  // namespace stellate::core
