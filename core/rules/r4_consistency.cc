#include "core/rules/r4_consistency.h"

#include "core/base/instantiate.h"
#include "core/complex/consistency.h"

namespace stellate::core {

template <int K>
std::optional<Violation<K>> WorstInconsistent(const Stars<K>& stars, std::uint32_t p,
                                              std::uint64_t consistent) {
  const auto& cell = stars.cell(p);
  const auto is_consistent = [&](std::size_t v) {
    return (v < 64 && (consistent >> v & 1) != 0) || IsConsistent<K>(stars, p, v);
  };
  std::optional<Folds<K>> folds;
  if (stars.centre_rule() == CentreRule::kCommonCentre) folds.emplace(stars, p);
  WorstVertex<K> worst(cell);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (worst.IsBeatenBy(v, cell.norm2(v)) && (!is_consistent(v) || (folds && folds->IsFolded(v))))
      worst.Take(v, cell.norm2(v));
  if (!worst.is_any()) return std::nullopt;
  return ViolationAt<K>(Rule::kInconsistent, cell, worst.vertex());
}

#define STELLATE_EACH(K)                                                                 \
  template std::optional<Violation<K>> WorstInconsistent(const Stars<K>&, std::uint32_t, \
                                                         std::uint64_t);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
