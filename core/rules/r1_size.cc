#include "core/rules/r1_size.h"

#include "core/base/instantiate.h"

namespace stellate::core {

template <int K>
std::optional<Violation<K>> WorstSize(const Stars<K>& stars, std::uint32_t p, double epsilon) {
  const auto& cell = stars.cell(p);
  if (cell.bounded() && cell.max_norm2() <= epsilon * epsilon) return std::nullopt;
  WorstVertex<K> worst(cell);
  bool fake = false;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    const bool is_fake = !cell.bounded() && cell.HasFakeFacet(v);
    const double radius2 = cell.norm2(v);
    if (!IsTooLarge(is_fake, radius2, epsilon) || !worst.IsBeatenBy(v, radius2)) continue;
    worst.Take(v, radius2);
    fake = is_fake;
  }
  if (!worst.is_any()) return std::nullopt;
  return ViolationAt<K>(Rule::kSize, cell, worst.vertex(), fake);
}

#define STELLATE_EACH(K) \
  template std::optional<Violation<K>> WorstSize(const Stars<K>&, std::uint32_t, double);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
