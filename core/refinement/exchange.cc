#include "core/refinement/exchange.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"

namespace stellate::core {
namespace {

template <int K>
using Simplices = std::vector<std::array<std::uint32_t, K + 1>>;

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
void ExchangeSimplices(const std::vector<std::uint32_t>& before,
                       const std::vector<std::uint32_t>& after, std::vector<std::uint32_t>* added,
                       std::vector<std::uint32_t>* removed) {
  const Simplices<K> old = Sorted<K>(before), now = Sorted<K>(after);
  const Simplices<K> lost = Difference<K>(old, now), won = Difference<K>(now, old);
  const Simplices<K> added_before = Sorted<K>(*added), removed_before = Sorted<K>(*removed);
  const Simplices<K> won_now = Difference<K>(won, removed_before),
                     lost_now = Difference<K>(lost, added_before);
  *added = Exchange<K>(added_before, lost, won_now);
  *removed = Exchange<K>(removed_before, won, lost_now);
}

#define STELLATE_EACH(K)                                                \
  template void ExchangeSimplices<K>(const std::vector<std::uint32_t>&, \
                                     const std::vector<std::uint32_t>&, \
                                     std::vector<std::uint32_t>*, std::vector<std::uint32_t>*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
