#include "core/complex/stars.h"

#include <cmath>
#include <functional>
#include <numeric>

#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/complex/bulk_star_builder.h"
#include "core/parts/share_out.h"

namespace stellate::core {
namespace {

// The point itself, and enough neighbours to close a cell.
template <int K>
inline constexpr int kNearestFirst = 2 * K + 3;

// So many new stars that follow each other are one part's to build.
constexpr std::size_t kSharedStars = 16;

// After a sample was added in bulk the rules mostly insert fewer points than one in so many.
constexpr std::size_t PartsToCome(int k) { return k <= 2 ? 8 : 4; }

// Whether a polygon has a vertex on both these facets.
template <typename Polygon>
bool HoldsTriangle(const Polygon& cell, std::uint32_t a, std::uint32_t b) {
  const std::size_t count = cell.facet_count();
  for (std::size_t v = 0; v < count; ++v)
    if (cell.id(v) == a)
      return cell.id(v + 1 < count ? v + 1 : 0) == b || cell.id(v > 0 ? v - 1 : count - 1) == b;
  return false;
}

// Calls visit(v, triangle) for the triangles of a polygon, the cell of p, whose lowest vertex is p.
template <typename Polygon, typename Visit>
void ForEachOwnedTriangle(std::uint32_t p, const Polygon& cell, const Visit& visit) {
  using Triangle = std::array<std::uint32_t, 3>;
  const std::size_t count = cell.facet_count();
  const auto is_above = [p](std::uint32_t q) { return q > p && IsSample(q); };
  for (std::size_t v = 0; v < count; ++v) {
    const std::uint32_t a = cell.id(v), b = cell.id(v + 1 < count ? v + 1 : 0);
    if (is_above(a) && is_above(b)) visit(v, a < b ? Triangle{p, a, b} : Triangle{p, b, a});
  }
}

template <std::size_t N>
void AppendTo(std::vector<std::uint32_t>* ids, const std::array<std::uint32_t, N>& simplex) {
  ids->insert(ids->end(), simplex.begin(), simplex.end());
}

// Whether a new point cuts a cell of p's star.
template <int K>
bool IsCutBy(const Stars<K>& stars, const StarBuilder<K>& builder, std::uint32_t p, const Site& q) {
  const Site site = stars.sample().At(p);
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector)
    if (builder.IsCutBy(stars.cell(p, sector), site, q)) return true;
  return false;
}

// Writes all cells of a point for another part, which Stars<K>::UnpackCells reads.
template <int K>
void PackCells(const Stars<K>& stars, std::uint32_t p, Peers::Bytes* message) {
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector)
    stars.cell(p, sector).PackTo(message);
}

// Consecutive new points are mostly near each other: stars in the order of their first cuts find in
// the cache what their neighbours have read.
std::vector<StarCuts> InTurns(const std::vector<StarCut>& cuts) {
  std::vector<StarCuts> turns =
      ParallelGather<StarCuts>(cuts.size(), [&](std::size_t i, auto* found) {
        if (i > 0 && cuts[i].star == cuts[i - 1].star) return;
        std::size_t end = i + 1;
        while (end < cuts.size() && cuts[end].star == cuts[i].star) ++end;
        found->push_back({cuts[i].by, cuts[i].star, i, end});
      });
  ParallelSort(turns, std::less<>());
  return turns;
}

// Among `count` ascending ids, with a place for one more. GCC 12 warns of std::sort of so few.
void InsertId(std::uint32_t id, std::uint32_t* ids, int* count) {
  int at = (*count)++;
  for (; at > 0 && ids[at - 1] > id; --at) ids[at] = ids[at - 1];
  ids[at] = id;
}

}  // namespace

// Calls visit(v, simplex) once for each simplex of a sector of star(p) whose lowest vertex is p: at
// common centres a cell that is far from convex may hold one at two vertices.
template <int K>
template <typename Visit>
void Stars<K>::ForEachOwned(std::uint32_t p, int sector, const Visit& visit) const {
  if (options_.boundary_only) return;
  const Cell& cell = this->cell(p, sector);
  if constexpr (K == 2) {
    if (centre_rule() == CentreRule::kTangentSpace) return ForEachOwnedTriangle(p, cell, visit);
  }
  Simplex simplex;
  thread_local std::vector<std::uint64_t> keys;
  keys.clear();
  for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
    bool lowest = true;
    for (int i = 0; i < K; ++i) lowest = lowest && cell.id(cell.facet(v, i)) > p;
    if (!lowest || !SimplexOf(p, cell, v, &simplex)) continue;
    if (centre_rule() == CentreRule::kCommonCentre) {
      if (std::find(keys.begin(), keys.end(), cell.key(v)) != keys.end()) continue;
      keys.push_back(cell.key(v));
    }
    visit(v, simplex);
  }
}

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
std::vector<std::int8_t> Stars<K>::LabelsOf(const std::vector<std::uint32_t>& simplices) const {
  std::vector<std::int8_t> labels;
  if (sample_.sectors().labels().empty()) return labels;
  labels.resize(simplices.size() / (K + 1));
  ParallelFor(labels.size(), [&](std::size_t i) {
    const std::uint32_t* const ids = simplices.data() + i * (K + 1);
    const std::uint32_t p = ids[0];
    Simplex simplex;
    const auto holds = [&](int sector) {
      const Cell& cell = this->cell(p, sector);
      for (std::size_t v = 0; v < cell.vertex_count(); ++v)
        if (SimplexOf(p, cell, v, &simplex) && std::equal(simplex.begin(), simplex.end(), ids))
          return true;
      return false;
    };
    int sector = sample_.sectors().Count(p) - 1;
    while (sector > 0 && !holds(sector)) --sector;
    labels[i] = static_cast<std::int8_t>(sample_.sectors().Label(p, sector));
  });
  return labels;
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

// Gives a point that was just added its places for the cells of its sectors but the first.
template <int K>
void Stars<K>::NoteSectors(std::uint32_t id) {
  const int sectors = sample_.sectors().Count(id);
  if (sectors < 2) return;
  more_at_.resize(id, 0);
  more_at_.push_back(more_count_);
  more_count_ += static_cast<std::size_t>(sectors) - 1;
}

template <int K>
typename Stars<K>::Cell& Stars<K>::MutableCell(std::uint32_t id, int sector) {
  return sector == 0 ? cells_[id]
                     : more_cells_[more_at_[id] + static_cast<std::size_t>(sector) - 1];
}

// Appends the sample points that most likely close a cell around q, the nearest first: the nearest
// points or, if a star near q is known, that star and the stars of its points nearest to q.
template <int K>
void Stars<K>::FindClosing(const double* q, std::uint32_t near,
                           std::vector<std::uint32_t>* ids) const {
  ids->clear();
  constexpr int kCount = kNearestFirst<K>;
  std::array<std::pair<double, std::uint32_t>, kCount> nearest;
  if (near == kNone || !cells_[near].bounded()) {
    const int count = sample_.Nearest(q, kCount, nearest.data());
    for (int i = 0; i < count; ++i) ids->push_back(nearest[static_cast<std::size_t>(i)].second);
    return;
  }
  int count = 0;
  const auto offer = [&](std::uint32_t id) {
    const std::pair<double, std::uint32_t> candidate{
        SquaredDistance(q, sample_.Point(id), sample_.d()), id};
    if (count == K + 1 && !(candidate < nearest[K])) return;
    int at = count < K + 1 ? count++ : K;
    for (; at > 0 && candidate < nearest[at - 1]; --at) nearest[at] = nearest[at - 1];
    nearest[at] = candidate;
  };
  offer(near);
  for (std::size_t f = 0; f < cells_[near].facet_count(); ++f)
    if (IsSample(cells_[near].id(f))) offer(cells_[near].id(f));
  const auto add = [&](std::uint32_t id) {
    if (IsSample(id) && std::find(ids->begin(), ids->end(), id) == ids->end()) ids->push_back(id);
  };
  for (int i = 0; i < count; ++i) ids->push_back(nearest[i].second);
  for (int i = 0; i < count; ++i) {
    const Cell& cell = cells_[nearest[i].second];
    for (std::size_t f = 0; f < cell.facet_count(); ++f) add(cell.id(f));
  }
}

template <int K>
void Stars<K>::TryPoint(const double* point, const double* tangent, std::uint32_t near,
                        Tentative* result, WallSet walls, const double* conormals,
                        WallSet signs) const {
  thread_local std::vector<std::uint32_t> closing, influenced;
  const Site guest{size(), point, tangent, walls, conormals, signs};
  const StarBuilder<K> builder = this->builder();
  FindClosing(point, near, &closing);
  const std::vector<Sector> sectors = sample_.sectors().Of(walls, signs);
  result->own.resize(sectors.size());
  for (std::size_t i = 0; i < sectors.size(); ++i)
    builder.Build(guest.Towards(sectors[i]), closing, &result->own[i], &influenced);
  result->cut.clear();
  for (const std::uint32_t p : influenced)
    for (int sector = 0; sector < sample_.sectors().Count(p); ++sector)
      if (builder.IsCutBy(cell(p, sector), sample_.At(p), guest))
        result->cut.push_back({p, sector, cell(p, sector)});
  for (auto& [p, sector, cell] : result->cut)
    builder.Clip(sample_.At(p, sector), guest, &result->own.front(), &cell);
  std::sort(result->cut.begin(), result->cut.end(), [](const auto& a, const auto& b) {
    return a.star != b.star ? a.star < b.star : a.sector < b.sector;
  });
}

// Also finds the old stars that each new point cuts, by star, with their influence before the cuts.
template <int K>
std::vector<StarCut> Stars<K>::BuildNewStars(std::uint32_t first) {
  cells_.resize(size());
  more_cells_.resize(more_count_);
  const StarBuilder<K> builder = this->builder();
  const auto build = [&](std::size_t i, std::vector<StarCut>* found) {
    thread_local std::vector<std::uint32_t> closing, influenced;
    thread_local Cell cell;  // its memory is used again; what is kept is as small as can be
    const Site q = sample_.At(first + static_cast<std::uint32_t>(i));
    FindClosing(q.point, near_[i], &closing);
    for (int sector = 0; sector < sample_.sectors().Count(q.id); ++sector) {
      builder.Build(sample_.At(q.id, sector), closing, &cell, &influenced);
      MutableCell(q.id, sector) = cell;
    }
    for (const std::uint32_t p : influenced)
      if (IsCutBy(*this, builder, p, q)) found->push_back({p, q.id});
  };
  std::vector<StarCut> cuts;
  if (peers_->parts() == 1) {
    cuts = ParallelGather<StarCut>(near_.size(), build);
  } else {
    std::vector<std::vector<StarCut>> found(near_.size());
    ShareOut(
        *peers_, found.size(), kSharedStars, [&](std::size_t i) { build(i, &found[i]); },
        [&](std::size_t i, Peers::Bytes* message) {
          PackCells(*this, first + static_cast<std::uint32_t>(i), message);
          PackAll(found[i], message);
        },
        [&](std::size_t i, Parcel* parcel) {
          UnpackCells(first + static_cast<std::uint32_t>(i), parcel);
          parcel->UnpackAll(&found[i]);
        });
    cuts = Concatenate(std::move(found));
  }
  near_.clear();
  ParallelSort(cuts, std::less<>());
  return cuts;
}

template <int K>
void Stars<K>::UnpackCells(std::uint32_t p, Parcel* parcel) {
  for (int sector = 0; sector < sample_.sectors().Count(p); ++sector)
    MutableCell(p, sector).Unpack(parcel);
}

// Returns the simplices whose lowest vertex is p, once each, with the label that LabelsOf gives
// them: a point may have one in several sectors as long as stars disagree about it.
template <int K>
std::vector<std::pair<typename Stars<K>::Simplex, int>> Stars<K>::OwnedInSectors(
    std::uint32_t p) const {
  std::vector<std::pair<Simplex, int>> owned;
  for (int sector = sample_.sectors().Count(p) - 1; sector >= 0; --sector)
    ForEachOwned(p, sector, [&](std::size_t, const Simplex& s) {
      owned.emplace_back(s, sample_.sectors().Label(p, sector));
    });
  const auto same = [](const auto& a, const auto& b) { return a.first == b.first; };
  std::stable_sort(owned.begin(), owned.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  owned.erase(std::unique(owned.begin(), owned.end(), same), owned.end());
  return owned;
}

// Clips a star of several sectors, and returns its influence. A simplex whose label changes goes
// and comes back.
template <int K>
double Stars<K>::CutSectors(std::uint32_t p, std::span<const StarCut> cuts,
                            std::vector<std::uint32_t>* added,
                            std::vector<std::uint32_t>* removed) {
  const auto before = OwnedInSectors(p);
  double influence = 0;
  for (int sector = 0; sector < sample_.sectors().Count(p); ++sector) {
    Cell& cell = MutableCell(p, sector);
    builder().Cut(sample_.At(p, sector), cuts, cells_, &cell);
    influence = std::max(influence, builder().Influence(p, cell));
  }
  const auto after = OwnedInSectors(p);
  for (const auto& entry : before)
    if (!std::binary_search(after.begin(), after.end(), entry)) AppendTo(removed, entry.first);
  for (const auto& entry : after)
    if (!std::binary_search(before.begin(), before.end(), entry)) AppendTo(added, entry.first);
  return influence;
}

// Clips the old stars. A simplex that a cut creates has the new point as a vertex, whose id is
// `first` or more; any other simplex was there before.
template <int K>
void Stars<K>::CutStars(const std::vector<StarCuts>& turns, const std::vector<StarCut>& cuts,
                        std::uint32_t first, Change* change) {
  const std::uint32_t count = size() - first;
  const StarBuilder<K> builder = this->builder();
  std::vector<std::vector<std::uint32_t>> removed(ChunkCount(turns.size()));
  std::vector<std::vector<std::uint32_t>> added(removed.size() + ChunkCount(count));
  std::vector<double> influence(turns.size() + count);
  const std::size_t size_of_chunk = ChunkSize(turns.size());
  const auto range = [&](std::size_t chunk) {
    const std::size_t begin = chunk * size_of_chunk;
    return std::pair(begin, std::min(turns.size(), begin + size_of_chunk));
  };
  const auto cut = [&](std::size_t chunk) {
    const auto [begin, end] = range(chunk);
    // For K = 2 the ids of the facets distinguish simplices, else keys.
    std::vector<std::pair<std::uint64_t, Simplex>> before;
    const auto key_of = [](const Cell& cell, std::size_t v) {
      return K == 2 ? std::uint64_t{0} : cell.key(v);
    };
    const auto is_left = [](const Cell& cell, std::uint64_t key, const Simplex& s) {
      if constexpr (K == 2) return HoldsTriangle(cell, s[1], s[2]);
      return cell.Find(key) != cell.vertex_count();
    };
    for (std::size_t i = begin; i < end && !IsInterrupted(); ++i) {
      const std::uint32_t p = turns[i].star;
      const auto own_cuts = std::span(cuts).subspan(turns[i].begin, turns[i].end - turns[i].begin);
      if (sample_.sectors().Count(p) > 1) {
        influence[i] = CutSectors(p, own_cuts, &added[chunk], &removed[chunk]);
        continue;
      }
      Cell& cell = cells_[p];
      before.clear();
      ForEachOwned(p, 0, [&](std::size_t v, const Simplex& s) {
        before.push_back({key_of(cell, v), s});
      });
      builder.Cut(sample_.At(p), own_cuts, cells_, &cell);
      for (const auto& [key, s] : before)
        if (!is_left(cell, key, s)) AppendTo(&removed[chunk], s);
      ForEachOwned(p, 0, [&](std::size_t, const Simplex& s) {
        if (s.back() >= first) AppendTo(&added[chunk], s);
      });
      influence[i] = builder.Influence(p, cell);
    }
  };
  ShareOut(
      *peers_, removed.size(), 1, cut,
      [&](std::size_t chunk, Peers::Bytes* message) {
        PackAll(removed[chunk], message);
        PackAll(added[chunk], message);
        const auto [begin, end] = range(chunk);
        for (std::size_t i = begin; i < end; ++i) {
          PackCells(*this, turns[i].star, message);
          Pack(influence[i], message);
        }
      },
      [&](std::size_t chunk, Parcel* parcel) {
        parcel->UnpackAll(&removed[chunk]);
        parcel->UnpackAll(&added[chunk]);
        const auto [begin, end] = range(chunk);
        for (std::size_t i = begin; i < end; ++i) {
          UnpackCells(turns[i].star, parcel);
          parcel->Unpack(1, &influence[i]);
        }
      });
  // A new point has the largest id of its simplices, except of those among new points alone.
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t p = first + static_cast<std::uint32_t>(i);
      std::vector<std::uint32_t>* const own = &added[removed.size() + chunk];
      double& reach = influence[turns.size() + i];
      const int sectors = sample_.sectors().Count(p);
      for (int sector = 0; sector < sectors; ++sector)
        reach = std::max(reach, builder.Influence(p, cell(p, sector)));
      if (sectors == 1)
        ForEachOwned(p, 0, [&](std::size_t, const Simplex& s) { AppendTo(own, s); });
      else
        for (const auto& entry : OwnedInSectors(p)) AppendTo(own, entry.first);
    }
  });
  SetInfluences(turns, first, influence);
  change->removed = Concatenate(std::move(removed));
  change->added = Concatenate(std::move(added));
  simplex_count_ += change->added.size() / (K + 1);
  simplex_count_ -= change->removed.size() / (K + 1);
}

// `influence`: of the stars of `turns`, and of those from `first` on.
template <int K>
void Stars<K>::SetInfluences(const std::vector<StarCuts>& turns, std::uint32_t first,
                             const std::vector<double>& influence) {
  BallTree& tree = sample_.tree();
  for (std::size_t i = 0; i < influence.size(); ++i) {
    CheckInterruption(i);
    const bool is_new = i >= turns.size();
    tree.SetInfluence(is_new ? first + static_cast<std::uint32_t>(i - turns.size()) : turns[i].star,
                      influence[i]);
  }
  tree.Refit();
  MeasureFaces(turns, first);
}

// Sets the influences of points on walls by their stars' simplices of faces alone: simplices inside
// are larger, and no point yields to them.
template <int K>
void Stars<K>::MeasureFaces(const std::vector<StarCuts>& turns, std::uint32_t first) {
  const std::vector<std::uint32_t>& boundary = sample_.boundary();
  if (boundary.empty()) return;
  std::vector<std::uint32_t> changed;  // by place in `boundary`
  for (const StarCuts& turn : turns) {
    CheckInterruption(changed.size());
    if (sample_.walls(turn.star) == 0) continue;
    const auto at = std::lower_bound(boundary.begin(), boundary.end(), turn.star);
    changed.push_back(static_cast<std::uint32_t>(at - boundary.begin()));
  }
  for (auto at = std::lower_bound(boundary.begin(), boundary.end(), first); at != boundary.end();
       ++at)
    changed.push_back(static_cast<std::uint32_t>(at - boundary.begin()));
  const StarBuilder<K> builder = this->builder();
  std::vector<double> influence(changed.size());
  ParallelFor(changed.size(), [&](std::size_t i) {
    const std::uint32_t p = boundary[changed[i]];
    double most2 = 0;
    for (int sector = 0; sector < sample_.sectors().Count(p); ++sector) {
      const Cell& cell = this->cell(p, sector);
      for (std::size_t v = 0; v < cell.vertex_count(); ++v)
        if (cell.norm2(v) > most2 && WallsAt<K>(cell, v) != 0 && !cell.HasFakeFacet(v))
          most2 = cell.norm2(v);
    }
    influence[i] = builder.Influence(p, most2);
  });
  BallTree& tree = sample_.boundary_tree();
  for (std::size_t i = 0; i < changed.size(); ++i) {
    CheckInterruption(i);
    tree.SetInfluence(changed[i], influence[i]);
  }
  tree.Refit();
}

template <int K>
typename Stars<K>::Change Stars<K>::Commit(std::vector<std::uint32_t>* around) {
  const auto first = static_cast<std::uint32_t>(cells_.size());
  if (!sample_.is_indexed()) return BuildAllInBulk();
  if (includes_interior_next_) return BuildAllAsAdded();
  if (size() == first) return {};
  return Insert(first, around);
}

template <int K>
typename Stars<K>::Change Stars<K>::Insert(std::uint32_t first,
                                           std::vector<std::uint32_t>* around) {
  Change change;
  const std::vector<StarCut> cuts = BuildNewStars(first);
  const std::vector<StarCuts> turns = InTurns(cuts);
  change.stars = ParallelGather<std::uint32_t>(
      turns.size(), [&](std::size_t i, auto* found) { found->push_back(turns[i].star); });

  const auto note_neighbours = [&](std::size_t count, const auto& star) {
    const auto found =
        ParallelGather<std::uint32_t>(count, [&](std::size_t i, std::vector<std::uint32_t>* ids) {
          for (int sector = 0; sector < sample_.sectors().Count(star(i)); ++sector) {
            const Cell& cell = this->cell(star(i), sector);
            for (std::size_t f = 0; f < cell.facet_count(); ++f)
              if (IsSample(cell.id(f))) ids->push_back(cell.id(f));
          }
        });
    around->insert(around->end(), found.begin(), found.end());
  };
  const auto changed = [&](std::size_t i) { return turns[i].star; };
  const auto born = [&](std::size_t i) { return first + static_cast<std::uint32_t>(i); };
  if (around) note_neighbours(turns.size(), changed);
  CutStars(turns, cuts, first, &change);
  if (around) {
    note_neighbours(turns.size(), changed);
    note_neighbours(size() - first, born);
  }
  return change;
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
