// What is left of a cell that is no convex polytope after a cut.

#include <algorithm>

#include "core/geometry/restricted_voronoi_cell.h"

namespace stellate::core {

// A judged cell is no convex polytope: a ball may take a bite that leaves a facet in pieces. Keeps
// of each facet, and of the whole, the largest piece. False if nothing is left.
template <int K>
bool RestrictedVoronoiCell<K>::Tidy(Scratch& scratch) const {
  const std::size_t count = vertices_.size();
  constexpr std::size_t kWhole = static_cast<std::size_t>(-1);
  const auto on = [&](const Vertex& v, std::size_t facet) {
    return facet == kWhole ||
           std::find(v.facet, v.facet + K, static_cast<Index>(facet)) != v.facet + K;
  };
  // Cuts off all pieces except the largest; returns whether there were others.
  const auto keep_largest = [&](std::size_t facet) {
    auto& seen = scratch.seen;
    seen.assign(count, 0);
    auto& pieces = scratch.pieces;
    pieces.clear();
    for (std::size_t start = 0; start < count; ++start) {
      if (scratch.cut[start] || seen[start] || !on(vertices_[start], facet)) continue;
      pieces.emplace_back(1, static_cast<Index>(start));
      seen[start] = 1;
      for (std::size_t i = 0; i < pieces.back().size(); ++i) {
        for (const Index w : vertices_[pieces.back()[i]].adjacent) {
          if (scratch.cut[w] || seen[w] || !on(vertices_[w], facet)) continue;
          seen[w] = 1;
          pieces.back().push_back(w);
        }
      }
    }
    if (pieces.size() < 2) return false;
    std::size_t largest = 0;
    for (std::size_t i = 1; i < pieces.size(); ++i)
      if (pieces[i].size() > pieces[largest].size()) largest = i;
    for (std::size_t i = 0; i < pieces.size(); ++i)
      if (i != largest)
        for (const Index v : pieces[i]) scratch.cut[v] = 1;
    return true;
  };
  // The pieces of a polygon are counted by the edges that the cut crosses: two is one piece.
  std::vector<std::uint16_t>& crossed = scratch.crossed;
  for (bool again = true; again;) {
    again = keep_largest(kWhole);
    crossed.assign(facets_.size(), 0);
    for (std::size_t i = 0; i < count; ++i) {
      if (!scratch.cut[i]) continue;
      for (int s = 0; s < K; ++s) {
        if (scratch.cut[vertices_[i].adjacent[s]]) continue;
        for (int r = 0; r < K; ++r)
          if (r != s) ++crossed[vertices_[i].facet[r]];
      }
    }
    for (std::size_t f = 0; f < facets_.size(); ++f)
      if (crossed[f] > (K <= 3 ? 2 : 0)) again |= keep_largest(f);
  }
  return std::find(scratch.cut.begin(), scratch.cut.end(), 0) != scratch.cut.end();
}

template bool RestrictedVoronoiCell<1>::Tidy(Scratch&) const;
template bool RestrictedVoronoiCell<3>::Tidy(Scratch&) const;
template bool RestrictedVoronoiCell<4>::Tidy(Scratch&) const;
STELLATE_ABOVE_3(template bool RestrictedVoronoiCell<5>::Tidy(Scratch&) const;)

}  // namespace stellate::core
