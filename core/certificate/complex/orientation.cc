#include "core/orientation.h"

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <map>
#include <span>
#include <utility>

#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/certificate/complex/facets.h"
#include "core/certificate/complex/signed_forest.h"
#include "core/certificate/complex/topology.h"

namespace stellate::core {
namespace {

using Coordinates = std::function<const double*(std::uint32_t)>;

// Ties all neighbours. False: they cannot all agree.
template <int K>
bool TieNeighbours(const SimplexList& list, SignedForest& forest) {
  const VertexStars stars(list);
  std::atomic<bool> orientable = true;
  ParallelChunks(list.vertices, [&](std::size_t /*chunk*/, std::size_t begin, std::size_t end) {
    const auto tie = [&](std::span<const SimplexFacet<K>> facet) {
      if (facet.size() == 1) return;
      const SimplexFacet<K>&a = facet[0], &b = facet[1];
      const bool flips = (a.omitted() + b.omitted()) % 2 == 0;
      if (facet.size() > 2 || !forest.Join(a.simplex(), b.simplex(), flips)) orientable = false;
    };
    ForEachFacet<K>(stars, static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end),
                    VertexStars::kNone, tie);
  });
  return orientable;
}

// d! times the volume between a simplex of a hypersurface (N = k + 1) and the origin, or of a
// simplex that fills space (N = k), as the order of its ids signs it.
template <int K, int N>
double Volume(const std::uint32_t* ids, const Coordinates& point) {
  using Column = Eigen::Map<const Eigen::Matrix<double, N, 1>>;
  Eigen::Matrix<double, N, N> sides;
  if constexpr (N == K) {
    const Column first(point(ids[0]));
    for (int i = 0; i < N; ++i) sides.col(i) = Column(point(ids[i + 1])) - first;
  } else {
    for (int i = 0; i < N; ++i) sides.col(i) = Column(point(ids[i]));
  }
  return sides.determinant();
}

// Which components, by their first simplices, have their normals inwards; ascending.
template <int K>
std::vector<std::uint32_t> FindInwards(const SimplexList& list, SignedForest& forest,
                                       const Coordinates& point) {
  using Volumes = std::map<std::uint32_t, double>;  // of components
  std::vector<Volumes> parts(ChunkCount(list.size()));
  ParallelChunks(list.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (auto s = static_cast<std::uint32_t>(begin); s < end; ++s) {
      const auto [root, flips] = forest.Climb(s);
      const double volume = Volume<K, K + 1>(list[s], point);
      parts[chunk][root] += flips != 0 ? -volume : volume;
    }
  });
  Volumes volumes;
  for (Volumes& part : parts) {
    ThrowIfInterrupted();
    for (const auto& [root, volume] : part) volumes[root] += volume;
    part.clear();
  }
  std::vector<std::uint32_t> inwards;
  for (const auto& [root, volume] : volumes)
    if (volume < 0) inwards.push_back(root);
  return inwards;
}

template <int K>
Orientation OrientOf(const SimplexList& list, int d, const Coordinates& point) {
  Orientation result;
  SignedForest forest(list.size());
  if (!TieNeighbours<K>(list, forest)) return result;
  result.orientable = true;
  result.turned.assign((std::size_t{list.size()} + 7) / 8, 0);
  const std::vector<std::uint32_t> inwards =
      d == K + 1 ? FindInwards<K>(list, forest, point) : std::vector<std::uint32_t>();
  ParallelFor(result.turned.size(), [&](std::size_t byte) {
    const std::size_t first = 8 * byte, end = std::min<std::size_t>(first + 8, list.size());
    for (std::size_t i = first; i < end; ++i) {
      const auto s = static_cast<std::uint32_t>(i);
      const auto [root, flips] = forest.Climb(s);
      bool turns = flips != 0;
      if (std::binary_search(inwards.begin(), inwards.end(), root)) turns = !turns;
      if (d == K) {
        const double volume = Volume<K, K>(list[s], point);
        if ((turns ? -volume : volume) < 0) turns = !turns;
      }
      if (turns) result.turned[byte] |= static_cast<std::uint8_t>(1u << (i - first));
    }
  });
  return result;
}

}  // namespace

Orientation Orient(int k, int d, std::uint32_t vertices,
                   const std::vector<std::uint32_t>& simplices, const Coordinates& point) {
  const SimplexList list{k, vertices, &simplices};
  if (!CheckSimplexList(list).empty()) return {};
  return WithMeshDimension(k, [&](auto constant) { return OrientOf<constant()>(list, d, point); });
}

}  // namespace stellate::core
