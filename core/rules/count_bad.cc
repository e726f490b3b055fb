#include "core/rules/count_bad.h"

#include <algorithm>

#include "core/base/instantiate.h"
#include "core/boundary/sharp_dihedrals.h"
#include "core/complex/consistency.h"

namespace stellate::core {

template <int K>
int CountBad(const Stars<K>& stars, const double* point,
             const typename Stars<K>::Tentative& tentative, const ShapeBounds& bounds,
             double small_radius, int enough, WallSet walls) {
  using Cell = RestrictedVoronoiCell<K>;
  using Simplex = typename Stars<K>::Simplex;
  const std::uint32_t id = stars.size();
  const auto changed = [&](std::uint32_t q) -> const Cell* {
    if (q == id) return &tentative.own;
    const auto at = std::lower_bound(tentative.cut.begin(), tentative.cut.end(), q,
                                     [](const auto& c, std::uint32_t x) { return c.first < x; });
    return at != tentative.cut.end() && at->first == q ? &at->second : nullptr;
  };
  int bad = 0;
  const auto has = [](const Cell& cell, std::uint32_t q, std::uint64_t key) {
    return cell.Find(key - Mix64(q)) < cell.vertex_count();
  };
  // Whether the dual of v is no simplex of a face yet, a foreign one, or one about which stars
  // disagree.
  const auto is_bad_face = [&](std::uint32_t p, const Cell& cell, std::size_t v) {
    const auto face = stars.FaceSimplexOf(p, cell, v, walls);
    if (face.fake || face.foreign) return true;
    const bool fresh = face.ids[static_cast<std::size_t>(face.count - 1)] == id;
    const std::uint64_t key = SimplexKey<K>(cell, v, p);
    for (int i = 0; i < face.count; ++i) {
      const std::uint32_t q = face.ids[static_cast<std::size_t>(i)];
      if (q == p) continue;
      const Cell* other = changed(q);
      if (!other && !fresh) continue;
      if (!other || !has(*other, q, key)) return true;
    }
    return false;
  };
  const auto is_badly_shaped = [&](std::uint32_t p, const double* at, const Cell& cell,
                                   std::size_t v) {
    return (bounds.sharpest_cosine < 1 &&
            HasSharpDihedral<K>(stars, p, at, cell, v, bounds.sharpest_cosine, point)) ||
           (!stars.TouchesProtectingBall(p, cell, v) &&
            (HasThinFaceAt<K>(stars, at, cell, v, bounds.sliver_bound, point) ||
             TiltsTooFar<K>(stars, p, at, cell, v, bounds.reach, point)));
  };
  const auto survey = [&](std::uint32_t p, const double* at, const Cell& cell) {
    Simplex simplex;
    const bool on_boundary = (p == id ? walls : stars.sample().walls(p)) != 0;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      if (bad >= enough) return;
      if (!stars.SimplexOf(p, cell, v, &simplex)) {
        bad += !on_boundary || is_bad_face(p, cell, v);
        continue;
      }
      const bool fresh = simplex.back() == id;  // an old simplex was judged before
      if (fresh && cell.norm2(v) <= small_radius * small_radius &&
          is_badly_shaped(p, at, cell, v)) {
        ++bad;
        continue;
      }
      const std::uint64_t key = SimplexKey<K>(cell, v, p);
      for (const std::uint32_t q : simplex) {
        if (q == p) continue;
        const Cell* other = changed(q);
        if (!other && !fresh) continue;
        if (!other || !FindSimplex<K>(*other, q, simplex, key)) {
          ++bad;
          break;
        }
      }
    }
  };
  survey(id, point, tentative.own);
  for (const auto& [p, cell] : tentative.cut) survey(p, stars.sample().Point(p), cell);
  // Counts simplices that a cut star loses and an uncut one keeps.
  for (const auto& [p, cell] : tentative.cut) {
    Simplex simplex;
    const Cell& before = stars.cell(p);
    for (std::size_t v = 0; v < before.vertex_count(); ++v) {
      if (bad >= enough) return bad;
      if (!stars.SimplexOf(p, before, v, &simplex)) continue;
      const std::uint64_t key = SimplexKey<K>(before, v, p);
      if (FindSimplex<K>(cell, p, simplex, key)) continue;
      for (const std::uint32_t q : simplex)
        if (q != p && !changed(q) && FindSimplex<K>(stars.cell(q), q, simplex, key)) {
          ++bad;
          break;
        }
    }
  }
  return bad;
}

#define STELLATE_EACH(K)                                                            \
  template int CountBad(const Stars<K>&, const double*, const Stars<K>::Tentative&, \
                        const ShapeBounds&, double, int, WallSet);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
