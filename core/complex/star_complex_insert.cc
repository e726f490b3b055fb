// How points are inserted, and the cuts that they make in the stars of others.

#include <algorithm>
#include <functional>
#include <numeric>
#include <span>
#include <utility>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/base/room.h"
#include "core/complex/around.h"
#include "core/complex/star_complex.h"

namespace stellate::core {

namespace {

// Whether a polygon has a vertex on both these facets.
template <typename Polygon>
bool HoldsTriangle(const Polygon& cell, std::uint32_t a, std::uint32_t b) {
  const std::size_t count = cell.facet_count();
  for (std::size_t v = 0; v < count; ++v)
    if (cell.id(v) == a)
      return cell.id(v + 1 < count ? v + 1 : 0) == b || cell.id(v > 0 ? v - 1 : count - 1) == b;
  return false;
}

}  // namespace

template <int K>
std::uint32_t StarComplex<K>::Append(const double* point, const double* tangent, std::uint32_t near,
                                     WallSet walls, const double* conormals) {
  const std::uint32_t id = size();
  if (walls != 0) {
    walls_.resize(id, 0);
    walls_.push_back(walls);
    conormals_at_.resize(id, 0);
    conormals_at_.push_back(static_cast<std::uint32_t>(conormals_.size()));
    conormals_.insert(conormals_.end(), conormals, conormals + K * CountWalls(walls));
    boundary_.push_back(id);
    boundary_points_.insert(boundary_points_.end(), point, point + d_);
    boundary_tree_.Insert(0);
  }
  near_.push_back(near);
  MakeRoom(stride(), &points_);
  MakeRoom(stride() * K, &tangents_);
  points_.insert(points_.end(), point, point + d_);
  tangents_.insert(tangents_.end(), tangent, tangent + d_ * K);
  tree_.Insert(0);  // until Commit it is found by place, but has no influence
  return id;
}

// New points that follow each other are mostly near each other: stars in the order in which these
// come to them find in the cache what their neighbours have read.
template <int K>
std::vector<typename StarComplex<K>::Turn> StarComplex<K>::InTurns(const std::vector<Cut>& cuts) {
  std::vector<Turn> turns = ParallelGather<Turn>(cuts.size(), [&](std::size_t i, auto* found) {
    if (i > 0 && cuts[i].star == cuts[i - 1].star) return;
    std::size_t end = i + 1;
    while (end < cuts.size() && cuts[end].star == cuts[i].star) ++end;
    found->push_back({cuts[i].by, cuts[i].star, i, end});
  });
  ParallelSort(turns, std::less<>());
  return turns;
}

template <int K>
void StarComplex<K>::CutStar(std::uint32_t p, std::span<const Cut> cuts) {
  if constexpr (K == 2)
    if (judging_ == Judging::kFlats && walls(p) == 0) return CutPolygon(p, cuts);
  thread_local typename Cell::Scratch scratch;
  for (const Cut& cut : cuts)
    ClipBy(cells_[p], At(p), At(cut.by), nullptr, &cells_[cut.by], scratch);
}

// Clips the old stars. A simplex that a cut creates has the new point that cuts, and so an id from
// `first` on; one without is as old as the star.
template <int K>
void StarComplex<K>::CutStars(const std::vector<Turn>& turns, const std::vector<Cut>& cuts,
                              std::uint32_t first, Change* change) {
  const std::uint32_t count = size() - first;
  std::vector<std::vector<std::uint32_t>> removed(ChunkCount(turns.size()));
  std::vector<std::vector<std::uint32_t>> added(removed.size() + ChunkCount(count));
  std::vector<double> influence(turns.size() + count);
  const auto append = [](const Simplex& s, std::vector<std::uint32_t>* ids) {
    ids->insert(ids->end(), s.begin(), s.end());
  };
  ParallelChunks(turns.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    // For K = 2 the ids of the facets tell simplices apart, else keys.
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
      Cell& cell = cells_[p];
      before.clear();
      ForEachOwned(p, [&](std::size_t v, const Simplex& s) {
        before.push_back({key_of(cell, v), s});
      });
      CutStar(p, std::span(cuts).subspan(turns[i].begin, turns[i].end - turns[i].begin));
      for (const auto& [key, s] : before)
        if (!is_left(cell, key, s)) append(s, &removed[chunk]);
      ForEachOwned(p, [&](std::size_t, const Simplex& s) {
        if (s.back() >= first) append(s, &added[chunk]);
      });
      influence[i] = Influence(p, cell);
    }
  });
  // A new point has the largest id of its simplices, except of those among new points alone.
  ParallelChunks(count, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t p = first + static_cast<std::uint32_t>(i);
      ForEachOwned(
          p, [&](std::size_t, const Simplex& s) { append(s, &added[removed.size() + chunk]); });
      influence[turns.size() + i] = Influence(p, cells_[p]);
    }
  });
  for (std::size_t i = 0; i < influence.size(); ++i) {
    CheckInterruption(i);
    const bool is_new = i >= turns.size();
    tree_.SetInfluence(
        is_new ? first + static_cast<std::uint32_t>(i - turns.size()) : turns[i].star,
        influence[i]);
  }
  tree_.Refit();
  MeasureFaces(turns, first);
  change->removed = Concatenate(std::move(removed));
  change->added = Concatenate(std::move(added));
  simplex_count_ += change->added.size() / (K + 1);
  simplex_count_ -= change->removed.size() / (K + 1);
}

template <int K>
typename StarComplex<K>::Change StarComplex<K>::Commit(std::vector<std::uint32_t>* around) {
  const auto first = static_cast<std::uint32_t>(cells_.size());
  Change change;
  if (tree_.size() < size()) return BuildLaidStars();
  if (becomes_whole_) return BuildAllStars();
  if (size() == first) return change;
  const std::vector<Cut> cuts = BuildNewStars(first);
  const std::vector<Turn> turns = InTurns(cuts);
  change.stars = ParallelGather<std::uint32_t>(
      turns.size(), [&](std::size_t i, auto* found) { found->push_back(turns[i].star); });

  const auto note_neighbours = [&](std::size_t count, const auto& star) {
    const auto found =
        ParallelGather<std::uint32_t>(count, [&](std::size_t i, std::vector<std::uint32_t>* ids) {
          const Cell& cell = cells_[star(i)];
          for (std::size_t f = 0; f < cell.facet_count(); ++f)
            if (IsSample(cell.id(f))) ids->push_back(cell.id(f));
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

template <int K>
typename StarComplex<K>::Change StarComplex<K>::BuildAllStars() {
  faces_alone_ = faces_alone_ && !becomes_whole_;
  becomes_whole_ = false;
  centre_owner_ = CentreCache<K>::NewOwner();
  tree_.Assign(std::vector<double>(size(), 0.0));
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
void StarComplex<K>::Guard(std::vector<double> radii2) {
  guards_ = std::move(radii2);
  largest_guard_ = guards_.empty() ? 0 : *std::max_element(guards_.begin(), guards_.end());
  BuildAllStars();
}

#define STELLATE_EACH(K)                                                                       \
  template std::uint32_t StarComplex<K>::Append(const double*, const double*, std::uint32_t,   \
                                                WallSet, const double*);                       \
  template std::vector<StarComplex<K>::Turn> StarComplex<K>::InTurns(const std::vector<Cut>&); \
  template void StarComplex<K>::CutStar(std::uint32_t, std::span<const Cut>);                  \
  template void StarComplex<K>::CutStars(const std::vector<Turn>&, const std::vector<Cut>&,    \
                                         std::uint32_t, Change*);                              \
  template StarComplex<K>::Change StarComplex<K>::Commit(std::vector<std::uint32_t>*);         \
  template StarComplex<K>::Change StarComplex<K>::BuildAllStars();                             \
  template void StarComplex<K>::Guard(std::vector<double>);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
