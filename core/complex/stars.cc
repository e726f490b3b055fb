#include "core/complex/stars.h"

#include <cmath>
#include <numeric>

#include "core/base/parallel.h"
#include "core/complex/bulk_star_builder.h"
#include "core/complex/owned_simplices.h"

namespace stellate::core {
namespace {

// After a sample was added in bulk the rules mostly insert fewer points than one in so many.
constexpr std::size_t PartsToCome(int k) { return k <= 2 ? 8 : 4; }

// Among `count` ascending ids, with a place for one more. GCC 12 warns of std::sort of so few.
void InsertId(std::uint32_t id, std::uint32_t* ids, int* count) {
  int at = (*count)++;
  for (; at > 0 && ids[at - 1] > id; --at) ids[at] = ids[at - 1];
  ids[at] = id;
}

}  // namespace

template <int K>
std::vector<std::uint32_t> Stars<K>::Simplices() const {
  return ParallelGather<std::uint32_t>(cells_.size(), [&](std::size_t p, auto* all) {
    thread_local std::vector<Simplex> owned;
    owned.clear();
    const int sectors = sample_.sectors().Count(static_cast<std::uint32_t>(p));
    for (int sector = 0; sector < sectors; ++sector)
      ForEachOwned(static_cast<std::uint32_t>(p), sector,
                   [&](std::size_t, const Simplex& s) { owned.push_back(s); });
    std::sort(owned.begin(), owned.end());
    if (sectors > 1) owned.erase(std::unique(owned.begin(), owned.end()), owned.end());
    for (const Simplex& s : owned) AppendTo(all, s);
  });
}

template <int K>
double Stars<K>::HalfSpace(std::uint32_t p, std::size_t facet, double* normal, int sector) const {
  const Cell& cell = this->cell(p, sector);
  if constexpr (K == 2) {
    return builder().HalfSpace(sample_.At(p, sector), cell.id(facet), normal);
  } else {
    std::copy_n(cell.normal(facet), K, normal);
    return cell.offset(facet);
  }
}

template <int K>
double Stars<K>::EdgeLength2(std::uint32_t p, std::size_t facet) const {
  const std::uint32_t q = cells_[p].id(facet);
  if constexpr (K == 2)
    return SquaredDistance(sample_.Point(p), sample_.Point(q), sample_.d());
  else
    return 2 * cells_[p].offset(facet) - sample_.ProtectingRadius2(p) +
           sample_.ProtectingRadius2(q);
}

template <int K>
bool Stars<K>::CutsVertex(const CellVertex& at, const double* point) const {
  Step step(sample_.d());
  double normal[K];
  const double offset = 0.5 * (sample_.Project(sample_.At(at.star), point, step.data(), normal) +
                               sample_.ProtectingRadius2(at.star));
  return cell(at.star, at.sector).WouldCutVertex(at.vertex, normal, offset, step.data());
}

template <int K>
typename Stars<K>::FaceSimplex Stars<K>::FaceSimplexOf(std::uint32_t p, const Cell& cell,
                                                       std::size_t v, WallSet guest_walls) const {
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
      InsertId(id, simplex.ids.data(), &simplex.count);
  }
  simplex.codimension = CountWalls(simplex.walls);
  simplex.walls = sample_.sectors().labels().Close(simplex.walls);
  const auto end = simplex.ids.begin() + simplex.count;
  simplex.foreign = std::any_of(simplex.ids.begin(), end, [&](std::uint32_t id) {
    return !IsSubset(simplex.walls, id == size() ? guest_walls : sample_.walls(id));
  });
  return simplex;
}

template <int K>
std::optional<typename Stars<K>::CellVertex> Stars<K>::EncroachedBy(const double* point,
                                                                    WallSet walls) const {
  const std::vector<std::uint32_t>& boundary = sample_.boundary();
  if (boundary.empty()) return std::nullopt;
  std::optional<CellVertex> worst;
  const int own = K - sample_.Codimension(walls);
  int lowest = own;
  double farthest2 = 0;
  Step step(sample_.d());
  sample_.boundary_tree().ForEachInfluencing(point, [&](std::uint32_t i) {
    const std::uint32_t p = boundary[i];
    if (IsSubset(sample_.walls(p), walls)) return;
    double normal[K];
    const double offset = 0.5 * (sample_.Project(sample_.At(p), point, step.data(), normal) +
                                 sample_.ProtectingRadius2(p));
    for (int sector = 0; sector < sample_.sectors().Count(p); ++sector) {
      const Cell& cell = this->cell(p, sector);
      for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
        // Few vertices are cut, so that this is checked first.
        if (!cell.WouldCutVertex(v, normal, offset, step.data())) continue;
        const WallSet at = WallsAt<K>(cell, v);
        const int dimension = K - CountWalls(at);
        if (IsSubset(at, walls) || dimension == 0 || dimension > lowest || cell.HasFakeFacet(v) ||
            sample_.sectors().Piece(p, sector, at) == 0)
          continue;
        const double norm2 = cell.norm2(v);
        const bool is_first = !worst && dimension < own;
        const bool is_worse = worst && (dimension < lowest || norm2 > farthest2 ||
                                        (norm2 == farthest2 && p < worst->star));
        if (!is_first && !is_worse) continue;
        worst = CellVertex{p, v, sector};
        lowest = dimension;
        farthest2 = norm2;
      }
    }
  });
  return worst;
}

template <int K>
typename Stars<K>::Change Stars<K>::Commit(std::vector<std::uint32_t>* around) {
  const auto first = static_cast<std::uint32_t>(cells_.size());
  if (!sample_.is_indexed()) return BuildAllInBulk();
  if (includes_interior_next_) return BuildAllAsAdded();
  if (size() == first) return {};
  return Insert(first, around);
}

// Rebuilds all stars, point by point, as if all points had just been added.
template <int K>
typename Stars<K>::Change Stars<K>::BuildAllAsAdded() {
  options_.boundary_only = options_.boundary_only && !includes_interior_next_;
  includes_interior_next_ = false;
  sample_.Index(BallTree::Halving::kNumber);
  near_.assign(size(), kNone);
  simplex_count_ = 0;
  Change change;
  change.stars.resize(cells_.size());
  std::iota(change.stars.begin(), change.stars.end(), std::uint32_t{0});
  BuildNewStars(0);
  CutStars({}, {}, 0, &change);
  return change;
}

template <int K>
typename Stars<K>::Change Stars<K>::BuildAllInBulk() {
  Change change;
  change.removed = Simplices();
  options_.boundary_only = includes_interior_next_ = false;
  change.stars.resize(cells_.size());
  std::iota(change.stars.begin(), change.stars.end(), std::uint32_t{0});
  cells_.resize(size());
  sample_.Index(BallTree::Halving::kExtent, PartsToCome(K));
  std::vector<double> influence(size());
  const StarBuilder<K> builder = this->builder();
  BulkStarBuilder<K>(builder, *peers_).Build(&cells_, influence.data());
  sample_.tree().SetInfluences(std::move(influence));
  MeasureFaces({}, 0);
  sample_.ForgetBounds();
  change.added = ParallelGather<std::uint32_t>(size(), [&](std::size_t p, auto* ids) {
    ForEachOwned(static_cast<std::uint32_t>(p), 0,
                 [&](std::size_t, const Simplex& s) { AppendTo(ids, s); });
  });
  simplex_count_ = change.added.size() / (K + 1);
  return change;
}

template <int K>
void Stars<K>::SetProtectingBalls(std::vector<double> radii2) {
  sample_.SetProtectingBalls(std::move(radii2));
  BuildAllAsAdded();
}

STELLATE_INSTANTIATE_CLASS(Stars)

}  // namespace stellate::core
