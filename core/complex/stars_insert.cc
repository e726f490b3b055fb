// How Stars takes new points: their stars are built, and those that they cut are clipped.

#include <algorithm>
#include <functional>
#include <span>

#include "core/base/interruption.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/complex/owned_simplices.h"
#include "core/complex/stars.h"
#include "core/parts/share_out.h"

namespace stellate::core {
namespace {

// The point itself, and enough neighbours to close a cell.
template <int K>
inline constexpr int kNearestFirst = 2 * K + 3;

// So many new stars that follow each other are one part's to build.
constexpr std::size_t kSharedStars = 16;

// Whether a polygon has a vertex on both these facets.
template <typename Polygon>
bool HoldsTriangle(const Polygon& cell, std::uint32_t a, std::uint32_t b) {
  const std::size_t count = cell.facet_count();
  for (std::size_t v = 0; v < count; ++v)
    if (cell.id(v) == a)
      return cell.id(v + 1 < count ? v + 1 : 0) == b || cell.id(v > 0 ? v - 1 : count - 1) == b;
  return false;
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

}  // namespace

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

#define STELLATE_EACH(K)                                                                          \
  template void Stars<K>::NoteSectors(std::uint32_t);                                             \
  template Stars<K>::Cell& Stars<K>::MutableCell(std::uint32_t, int);                             \
  template void Stars<K>::FindClosing(const double*, std::uint32_t, std::vector<std::uint32_t>*)  \
      const;                                                                                      \
  template void Stars<K>::TryPoint(const double*, const double*, std::uint32_t, Tentative*,       \
                                   WallSet, const double*, WallSet) const;                        \
  template std::vector<StarCut> Stars<K>::BuildNewStars(std::uint32_t);                           \
  template void Stars<K>::UnpackCells(std::uint32_t, Parcel*);                                    \
  template std::vector<std::pair<Stars<K>::Simplex, int>> Stars<K>::OwnedInSectors(std::uint32_t) \
      const;                                                                                      \
  template double Stars<K>::CutSectors(std::uint32_t, std::span<const StarCut>,                   \
                                       std::vector<std::uint32_t>*, std::vector<std::uint32_t>*); \
  template void Stars<K>::CutStars(const std::vector<StarCuts>&, const std::vector<StarCut>&,     \
                                   std::uint32_t, Change*);                                       \
  template void Stars<K>::SetInfluences(const std::vector<StarCuts>&, std::uint32_t,              \
                                        const std::vector<double>&);                              \
  template void Stars<K>::MeasureFaces(const std::vector<StarCuts>&, std::uint32_t);              \
  template Stars<K>::Change Stars<K>::Insert(std::uint32_t, std::vector<std::uint32_t>*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
