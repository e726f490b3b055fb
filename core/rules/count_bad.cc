#include "core/rules/count_bad.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/boundary/sharp_dihedrals.h"
#include "core/complex/consistency.h"
#include "core/rules/r5_protection.h"

namespace stellate::core {

namespace {

// The stars as they would be with one more point.
template <int K>
class StarsWithGuest {
 public:
  using Cell = RestrictedVoronoiCell<K>;

  StarsWithGuest(const Stars<K>& stars, const typename Stars<K>::Tentative& tentative,
                 WallSet walls, WallSet signs)
      : stars_(stars), tentative_(tentative), sectors_(stars.sample().sectors().Of(walls, signs)) {}

  std::uint32_t guest() const { return stars_.size(); }
  // Returns the cell of a sector of q if it would change, else null.
  const Cell* Changed(std::uint32_t q, int sector) const {
    if (q == guest()) return &tentative_.own[static_cast<std::size_t>(sector)];
    const auto at = std::lower_bound(
        tentative_.cut.begin(), tentative_.cut.end(), std::pair(q, sector),
        [](const auto& c, const auto& x) { return std::pair(c.star, c.sector) < x; });
    const bool is_cut = at != tentative_.cut.end() && at->star == q && at->sector == sector;
    return is_cut ? &at->cell : nullptr;
  }
  bool IsChanged(std::uint32_t q) const {
    for (int sector = 0; sector < CountSectors(q); ++sector)
      if (Changed(q, sector)) return true;
    return false;
  }
  // As Sample::Piece, of the face of a vertex of a cell.
  std::uint64_t PieceAt(std::uint32_t q, int sector, const Cell& cell, std::size_t v) const {
    const LabelTable& labels = stars_.sample().sectors().labels();
    if (labels.empty()) return 1;
    return labels.Piece(WallsAt<K>(cell, v), q == guest()
                                                 ? sectors_[static_cast<std::size_t>(sector)].signs
                                                 : stars_.sample().sectors().SignsOf(q, sector));
  }
  // Whether star(q) would lack a simplex that another star has. `fresh`: the guest is a vertex of
  // it; else it was judged before, and counts only if star(q) changes.
  bool Lacks(std::uint32_t q, std::uint64_t key, std::uint64_t piece, bool fresh) const {
    const int sectors = CountSectors(q);
    bool any_changed = false;
    for (int sector = 0; sector < sectors; ++sector) {
      const Cell* const other = Changed(q, sector);
      if (!other && sectors == 1) return fresh;
      any_changed = any_changed || other;
      const Cell& cell = other ? *other : stars_.cell(q, sector);
      const std::size_t v = cell.Find(key - Mix64(q));
      if (v < cell.vertex_count() && PieceAt(q, sector, cell, v) == piece) return false;
    }
    return any_changed || fresh;
  }

 private:
  int CountSectors(std::uint32_t q) const {
    return q == guest() ? static_cast<int>(sectors_.size()) : stars_.sample().sectors().Count(q);
  }

  const Stars<K>& stars_;
  const typename Stars<K>::Tentative& tentative_;
  std::vector<Sector> sectors_;  // of the guest
};

}  // namespace

template <int K>
int CountBad(const Stars<K>& stars, const Site& guest,
             const typename Stars<K>::Tentative& tentative, const ShapeBounds& bounds,
             double small_radius, int enough) {
  using Cell = RestrictedVoronoiCell<K>;
  using Simplex = typename Stars<K>::Simplex;
  const std::uint32_t id = guest.id;
  const double* const point = guest.point;
  const WallSet walls = guest.walls;
  const StarsWithGuest<K> with(stars, tentative, walls, guest.signs);
  int bad = 0;
  // Whether the dual of v is no simplex of a face yet, a foreign one, or one about which stars
  // disagree.
  const auto is_bad_face = [&](std::uint32_t p, int sector, const Cell& cell, std::size_t v) {
    const auto face = stars.FaceSimplexOf(p, cell, v, walls);
    const std::uint64_t piece = with.PieceAt(p, sector, cell, v);
    if (piece == 0) return false;
    if (face.fake || face.foreign) return true;
    const bool fresh = face.ids[static_cast<std::size_t>(face.count - 1)] == id;
    const std::uint64_t key = SimplexKey<K>(cell, v, p);
    return std::any_of(face.ids.begin(), face.ids.begin() + face.count,
                       [&](std::uint32_t q) { return q != p && with.Lacks(q, key, piece, fresh); });
  };
  const auto is_badly_shaped = [&](std::uint32_t p, const double* at, const Cell& cell,
                                   std::size_t v) {
    return (bounds.sharpest_cosine < 1 &&
            HasSharpDihedral<K>(stars, p, at, cell, v, bounds.sharpest_cosine, point)) ||
           (!stars.TouchesProtectingBall(p, cell, v) &&
            (HasThinFaceAt<K>(stars, at, cell, v, bounds.sliver_bound, point) ||
             TiltsTooFar<K>(stars, p, at, cell, v, bounds.reach, point)));
  };
  const auto survey = [&](std::uint32_t p, int sector, const double* at, const Cell& cell) {
    Simplex simplex;
    const bool on_boundary = (p == id ? walls : stars.sample().walls(p)) != 0;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      if (bad >= enough) return;
      if (!stars.SimplexOf(p, cell, v, &simplex)) {
        bad += !on_boundary || is_bad_face(p, sector, cell, v);
        continue;
      }
      const bool fresh = simplex.back() == id;  // an old simplex was judged before
      if (fresh && cell.norm2(v) <= small_radius * small_radius &&
          is_badly_shaped(p, at, cell, v)) {
        ++bad;
        continue;
      }
      const std::uint64_t key = SimplexKey<K>(cell, v, p);
      const std::uint64_t piece = with.PieceAt(p, sector, cell, v);
      bad += std::any_of(simplex.begin(), simplex.end(), [&](std::uint32_t q) {
        return q != p && with.Lacks(q, key, piece, fresh);
      });
    }
  };
  for (std::size_t i = 0; i < tentative.own.size(); ++i)
    survey(id, static_cast<int>(i), point, tentative.own[i]);
  for (const auto& [p, sector, cell] : tentative.cut)
    survey(p, sector, stars.sample().Point(p), cell);
  // Counts simplices that a cut star loses and an uncut one keeps.
  for (const auto& cut : tentative.cut) {
    const std::uint32_t p = cut.star;
    Simplex simplex;
    const Cell& before = stars.cell(p, cut.sector);
    for (std::size_t v = 0; v < before.vertex_count(); ++v) {
      if (bad >= enough) return bad;
      if (!stars.SimplexOf(p, before, v, &simplex)) continue;
      const std::uint64_t key = SimplexKey<K>(before, v, p);
      if (FindSimplex<K>(cut.cell, p, simplex, key)) continue;
      const std::uint64_t piece = with.PieceAt(p, cut.sector, before, v);
      bad += std::any_of(simplex.begin(), simplex.end(), [&](std::uint32_t q) {
        return q != p && !with.IsChanged(q) && HasSimplex<K>(stars, q, key, piece);
      });
    }
  }
  if (bounds.protection > 0 && bad < enough)
    bad += CountUnprotected<K>(stars, guest, tentative, bounds.protection, enough - bad);
  return bad;
}

#define STELLATE_EACH(K)                                                          \
  template int CountBad(const Stars<K>&, const Site&, const Stars<K>::Tentative&, \
                        const ShapeBounds&, double, int);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
