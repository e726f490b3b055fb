#include "core/rules/r2_radius_edge.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/instantiate.h"

namespace stellate::core {

template <int K>
std::optional<Violation<K>> WorstRadiusEdge(const Stars<K>& stars, std::uint32_t p, double bound) {
  const auto& cell = stars.cell(p);
  thread_local std::vector<double> edges2;
  edges2.clear();
  for (std::size_t f = 0; f < cell.facet_count(); ++f) edges2.push_back(stars.EdgeLength2(p, f));
  const double bound2 = bound * bound;
  // Mostly the longest radius is short enough for the shortest edge.
  if (cell.max_norm2() <= bound2 * *std::min_element(edges2.begin(), edges2.end()))
    return std::nullopt;
  WorstVertex<K> worst(cell);
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    double edge2 = INFINITY;
    for (int s = 0; s < K; ++s) edge2 = std::min(edge2, edges2[cell.facet(v, s)]);
    const double ratio2 = cell.norm2(v) / edge2;
    if (!(ratio2 > bound2) || !worst.IsBeatenBy(v, ratio2)) continue;
    if (!stars.TouchesProtectingBall(p, cell, v)) worst.Take(v, ratio2);
  }
  if (!worst.is_any()) return std::nullopt;
  return ViolationAt<K>(Rule::kRadiusEdge, cell, worst.vertex());
}

#define STELLATE_EACH(K) \
  template std::optional<Violation<K>> WorstRadiusEdge(const Stars<K>&, std::uint32_t, double);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
