#include "core/certificate/complex/betti.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "core/base/interruption.h"
#include "core/certificate/complex/parts.h"

namespace stellate::core {
namespace {

struct Edge {
  std::array<std::uint32_t, 2> ids;
  std::size_t triangle;
};

}  // namespace

std::vector<std::int64_t> BettiNumbers(int dimension, std::int64_t components,
                                       std::int64_t euler_characteristic,
                                       const std::vector<std::uint32_t>& simplices) {
  if (dimension == 0) return {components};
  if (dimension == 1) return {components, components - euler_characteristic};
  if (dimension > 2) return {};
  // A cycle of dimension 2 has, with one triangle, all that hang together with it by edges.
  std::vector<Edge> edges;
  for (std::size_t s = 0; s < simplices.size(); s += 3)
    for (std::size_t out = 0; out < 3; ++out)
      edges.push_back({{simplices[s + (out == 0)], simplices[s + 2 - (out == 2)]}, s / 3});
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::pair(a.ids, a.triangle) < std::pair(b.ids, b.triangle);
  });
  Parts parts(simplices.size() / 3);
  std::vector<std::size_t> at_the_end;
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    CheckInterruption(begin);
    while (end < edges.size() && edges[end].ids == edges[begin].ids) ++end;
    if (end - begin > 2) return {};
    if (end - begin == 2)
      parts.Join(edges[begin].triangle, edges[begin + 1].triangle);
    else
      at_the_end.push_back(edges[begin].triangle);
  }
  std::set<std::size_t> open;
  for (const std::size_t triangle : at_the_end) open.insert(parts.Root(triangle));
  const auto closed = static_cast<std::int64_t>(parts.Count() - open.size());
  return {components, components + closed - euler_characteristic, closed};
}

}  // namespace stellate::core
