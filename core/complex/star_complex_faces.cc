// What the stars of a manifold with boundary say of its faces.

#include <algorithm>
#include <cmath>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/complex/star_complex.h"

namespace stellate::core {

template <int K>
typename StarComplex<K>::FaceSimplex StarComplex<K>::FaceSimplexOf(std::uint32_t p,
                                                                   const Cell& cell, std::size_t v,
                                                                   WallSet guest_walls) const {
  FaceSimplex simplex;
  simplex.ids[0] = p;
  simplex.count = 1;
  for (int s = 0; s < K; ++s) {
    const std::uint32_t id = cell.id(cell.facet(v, s));
    if (IsFake(id))
      simplex.fake = true;
    else if (IsWall(id))
      simplex.walls |= SetOfWall(WallOf(id));
    else
      simplex.ids[static_cast<std::size_t>(simplex.count++)] = id;
  }
  const auto end = simplex.ids.begin() + simplex.count;
  std::sort(simplex.ids.begin(), end);
  simplex.foreign = std::any_of(simplex.ids.begin(), end, [&](std::uint32_t id) {
    return !IsSubset(simplex.walls, id == size() ? guest_walls : walls(id));
  });
  return simplex;
}

template <int K>
double StarComplex<K>::MaxNorm2OnFaces(const Cell& cell) {
  double most2 = 0;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (cell.norm2(v) > most2 && WallsAt<K>(cell, v) != 0) most2 = cell.norm2(v);
  return most2 > 0 ? most2 : cell.max_norm2();  // of a point inside: all of it
}

// Of simplices of faces alone: those inside are larger, and no point yields to them.
template <int K>
void StarComplex<K>::MeasureFaces(const std::vector<Turn>& turns, std::uint32_t first) {
  if (boundary_.empty()) return;
  std::vector<std::uint32_t> changed;  // by place in boundary_
  for (const Turn& turn : turns) {
    CheckInterruption(changed.size());
    if (walls(turn.star) == 0) continue;
    const auto at = std::lower_bound(boundary_.begin(), boundary_.end(), turn.star);
    changed.push_back(static_cast<std::uint32_t>(at - boundary_.begin()));
  }
  for (auto at = std::lower_bound(boundary_.begin(), boundary_.end(), first); at != boundary_.end();
       ++at)
    changed.push_back(static_cast<std::uint32_t>(at - boundary_.begin()));
  std::vector<double> influence(changed.size());
  ParallelFor(changed.size(), [&](std::size_t i) {
    const std::uint32_t p = boundary_[changed[i]];
    const Cell& cell = cells_[p];
    double most2 = 0;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v)
      if (cell.norm2(v) > most2 && WallsAt<K>(cell, v) != 0 && !cell.HasFakeFacet(v))
        most2 = cell.norm2(v);
    influence[i] = Influence(p, most2);
  });
  for (std::size_t i = 0; i < changed.size(); ++i) {
    CheckInterruption(i);
    boundary_tree_.SetInfluence(changed[i], influence[i]);
  }
  boundary_tree_.Refit();
}

template <int K>
std::optional<typename StarComplex<K>::CellVertex> StarComplex<K>::EncroachedBy(
    const double* point, WallSet walls) const {
  if (boundary_.empty()) return std::nullopt;
  std::optional<CellVertex> worst;
  const int own = K - CountWalls(walls);
  int lowest = own;
  double farthest2 = 0;
  std::vector<double> step(stride());
  boundary_tree_.ForEachInfluencing(point, [&](std::uint32_t i) {
    const std::uint32_t p = boundary_[i];
    if (IsSubset(this->walls(p), walls)) return;
    const Cell& cell = cells_[p];
    double normal[K];
    const double offset = 0.5 * (Project(At(p), point, step.data(), normal) + GuardOf(p));
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      // Few vertices are cut: that is asked first.
      if (!cell.WouldCutVertex(v, normal, offset, step.data())) continue;
      const WallSet at = WallsAt<K>(cell, v);
      const int dimension = K - CountWalls(at);
      if (IsSubset(at, walls) || dimension == 0 || dimension > lowest || cell.HasFakeFacet(v))
        continue;
      const double norm2 = cell.norm2(v);
      const bool is_first = !worst && dimension < own;
      const bool is_worse = worst && (dimension < lowest || norm2 > farthest2 ||
                                      (norm2 == farthest2 && p < worst->star));
      if (!is_first && !is_worse) continue;
      worst = CellVertex{p, v};
      lowest = dimension;
      farthest2 = norm2;
    }
  });
  return worst;
}

template <int K>
bool StarComplex<K>::InGuard(const double* point) const {
  if (!has_guards()) return false;
  bool in = false;
  tree_.VisitNear(
      point, [&] { return std::sqrt(largest_guard_); },
      [&](std::uint32_t id, double distance2) { in = in || distance2 < GuardOf(id); });
  return in;
}

#define STELLATE_EACH(K)                                                                          \
  template StarComplex<K>::FaceSimplex StarComplex<K>::FaceSimplexOf(std::uint32_t, const Cell&,  \
                                                                     std::size_t, WallSet) const; \
  template double StarComplex<K>::MaxNorm2OnFaces(const Cell&);                                   \
  template void StarComplex<K>::MeasureFaces(const std::vector<Turn>&, std::uint32_t);            \
  template bool StarComplex<K>::InGuard(const double*) const;                                     \
  template std::optional<StarComplex<K>::CellVertex> StarComplex<K>::EncroachedBy(const double*,  \
                                                                                  WallSet) const;
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
