#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <iterator>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/complex/consistency.h"

namespace stellate::core {

// The simplices of the stars in one region of an arrangement, or of all stars, divided into those
// on which all these stars agree and the doubtful ones.
//
//   const Census<K> census(stars, region);
//   for (const auto& cavity : PartDoubtful(census)) ...  // fill it: core/complex/cavities.h
//   output.insert(output.end(), census.agreed.begin(), census.agreed.end());
template <int K>
struct Census {
  using Simplex = typename Stars<K>::Simplex;
  using Facet = std::array<std::uint32_t, K>;

  // `region`: as Sectors::Piece identifies it, for no walls.
  explicit Census(const Stars<K>& whole, std::uint64_t of) : stars(whole), region(of) {
    const std::uint32_t n = stars.size();
    const std::size_t chunks = ChunkCount(n);
    std::vector<std::vector<Simplex>> owned(chunks), doubts(chunks);
    ParallelChunks(n, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        Survey(static_cast<std::uint32_t>(i), owned[chunk], doubts[chunk]);
    });
    for (std::size_t c = 0; c < chunks; ++c) {
      agreed.insert(agreed.end(), owned[c].begin(), owned[c].end());
      all_doubts.insert(all_doubts.end(), doubts[c].begin(), doubts[c].end());
    }
    ParallelSort(all_doubts, std::less<>());
    doubtful = all_doubts;
    doubtful.erase(std::unique(doubtful.begin(), doubtful.end()), doubtful.end());
    ParallelSort(agreed, std::less<>());
    std::vector<Simplex> rest;
    std::set_difference(agreed.begin(), agreed.end(), doubtful.begin(), doubtful.end(),
                        std::back_inserter(rest));
    agreed = std::move(rest);
  }

  // Returns in how many stars a doubtful simplex was found.
  int Holders(const Simplex& s) const {
    const auto range = std::equal_range(all_doubts.begin(), all_doubts.end(), s);
    return static_cast<int>(range.second - range.first);
  }
  bool IsDoubtful(const Simplex& s) const {
    return std::binary_search(doubtful.begin(), doubtful.end(), s);
  }

  // Returns the point's sector in the region; nothing if it has none there, or several.
  std::optional<int> SectorOf(std::uint32_t p) const {
    std::optional<int> found;
    for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
      if (!IsHere(p, sector)) continue;
      if (found) return std::nullopt;
      found = sector;
    }
    return found;
  }

  // Writes the agreed simplices on a facet and returns their number: two at most, as the facet is
  // an edge of a cell.
  int AgreedOn(const Facet& facet, Simplex (&found)[2]) const {
    const std::uint32_t p = facet[0];
    const std::optional<int> sector = SectorOf(p);
    if (!sector) return 0;
    const auto& cell = stars.cell(p, *sector);
    int count = 0;
    Simplex s;
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      int has = 0;
      for (int i = 0; i < K; ++i)
        has += std::binary_search(facet.begin() + 1, facet.end(), cell.id(cell.facet(v, i)));
      if (has < K - 1 || !stars.SimplexOf(p, cell, v, &s) || IsDoubtful(s)) continue;
      if (count < 2) found[count] = s;
      ++count;
    }
    return std::min(count, 2);
  }

  // Returns the wall that a facet lies in, beyond which there is no simplex, if the stars agree
  // that the facet is on that face.
  std::optional<int> WallUnder(const Facet& facet) const {
    const std::uint32_t p = facet[0];
    const std::optional<int> sector = SectorOf(p);
    if (stars.sample().walls(p) == 0 || !sector) return std::nullopt;
    const auto& cell = stars.cell(p, *sector);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const auto simplex = stars.FaceSimplexOf(p, cell, v);
      if (simplex.fake || CountWalls(simplex.walls) != 1 || simplex.count != K) continue;
      if (std::equal(facet.begin(), facet.end(), simplex.ids.begin()) &&
          IsConsistent<K>(stars, p, v, *sector))
        return std::countr_zero(simplex.walls);
    }
    return std::nullopt;
  }
  // Whether agreed simplices are on both sides of a facet, or on the one that a facet in a wall
  // has.
  bool IsClosed(const Facet& facet) const {
    Simplex found[2];
    const int count = AgreedOn(facet, found);
    return count == 2 || (count == 1 && WallUnder(facet));
  }

  const Stars<K>& stars;
  const std::uint64_t region;
  // Sorted, each once: in all stars of its vertices; in some of them, or folded over its
  // neighbours.
  std::vector<Simplex> agreed, doubtful;
  std::vector<Simplex> all_doubts;  // doubtful ones, once for each star that has them

 private:
  bool IsHere(std::uint32_t p, int sector) const {
    return stars.sample().sectors().Piece(p, sector, 0) == region;
  }

  // Adds what a star agrees on to `owned`, if p is the lowest vertex, which one star of each
  // simplex has, and the rest to `doubts`.
  void Survey(std::uint32_t p, std::vector<Simplex>& owned, std::vector<Simplex>& doubts) const {
    for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
      if (!IsHere(p, sector)) continue;
      const auto& cell = stars.cell(p, sector);
      const Folds<K> folds(stars, p, sector);
      Simplex s;
      for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
        if (!stars.SimplexOf(p, cell, v, &s)) continue;
        if (!IsConsistent<K>(stars, p, v, sector) || folds.IsFolded(v))
          doubts.push_back(s);
        else if (s[0] == p)
          owned.push_back(s);
      }
    }
  }
};

// Doubtful simplices that share a facet lie in one cavity, unless agreed ones are on both its
// sides, or on the one that it has in a wall.
template <int K>
std::vector<std::vector<typename Stars<K>::Simplex>> PartDoubtful(const Census<K>& census) {
  using Facet = typename Census<K>::Facet;
  const auto& doubtful = census.doubtful;
  std::vector<std::pair<Facet, std::uint32_t>> facets;
  facets.reserve(doubtful.size() * (K + 1));
  for (std::size_t s = 0; s < doubtful.size(); ++s)
    for (int i = 0; i <= K; ++i) {
      Facet facet;
      std::copy(doubtful[s].begin(), doubtful[s].begin() + i, facet.begin());
      std::copy(doubtful[s].begin() + i + 1, doubtful[s].end(), facet.begin() + i);
      facets.emplace_back(facet, static_cast<std::uint32_t>(s));
    }
  ParallelSort(facets, std::less<>());
  std::vector<std::size_t> parent(doubtful.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t s) {
    while (parent[s] != s) s = parent[s] = parent[parent[s]];
    return s;
  };
  for (std::size_t i = 0; i + 1 < facets.size(); ++i) {
    CheckInterruption(i);
    if (facets[i].first != facets[i + 1].first) continue;
    const std::size_t a = root(facets[i].second), b = root(facets[i + 1].second);
    if (a == b) continue;
    if (!census.IsClosed(facets[i].first)) parent[std::max(a, b)] = std::min(a, b);
  }
  std::vector<std::size_t> number(doubtful.size());
  std::vector<std::vector<typename Stars<K>::Simplex>> parts;
  for (std::size_t s = 0; s < doubtful.size(); ++s) {
    const std::size_t r = root(s);
    if (r == s) {
      number[s] = parts.size();
      parts.emplace_back();
    }
    parts[number[r]].push_back(doubtful[s]);
  }
  return parts;
}

}  // namespace stellate::core
