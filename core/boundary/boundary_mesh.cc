#include "core/boundary/boundary_mesh.h"

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cstddef>
#include <utility>

#include "core/base/parallel.h"

namespace stellate::core {
namespace {

template <int K>
const double* OneConormal(const Sample<K>& sample, std::uint32_t p, int wall) {
  return sample.Conormals(p) + K * CountWalls(sample.walls(p) & (SetOfWall(wall) - 1));
}

// Writes the labels on both sides of a simplex whose wall has them below and above it.
template <int K>
void SetSides(const Sample<K>& sample, int below, int above, BoundarySimplex<K>* simplex) {
  simplex->behind = static_cast<std::int8_t>(above);
  simplex->ahead = static_cast<std::int8_t>(below);
  if (sample.d() != K) return;
  using Column = Eigen::Map<const Eigen::Matrix<double, K, 1>>;
  double conormals[K * K];
  ConormalsAt<K>(sample, *simplex, conormals);
  Eigen::Matrix<double, K, K> columns;  // the conormals' mean, K times, and the edges
  columns.col(0) = Eigen::Map<const Eigen::Matrix<double, K, K>>(conormals).rowwise().sum();
  const Column first(sample.Point(simplex->ids[0]));
  for (int i = 1; i < K; ++i)
    columns.col(i) = Column(sample.Point(simplex->ids[static_cast<std::size_t>(i)])) - first;
  if (columns.determinant() < 0) std::swap(simplex->behind, simplex->ahead);
}

}  // namespace

template <int K>
void ConormalsAt(const Sample<K>& sample, const BoundarySimplex<K>& simplex, double* conormals) {
  const int d = sample.d();
  for (const std::uint32_t p : simplex.ids) {
    std::fill_n(conormals, d, 0.0);
    for (int a = 0; a < K; ++a)
      for (int i = 0; i < d; ++i)
        conormals[i] += OneConormal<K>(sample, p, simplex.wall)[a] * sample.Tangent(p)[a * d + i];
    conormals += d;
  }
}

template <int K>
std::vector<BoundarySimplex<K>> BoundarySimplices(const Stars<K>& stars) {
  const std::vector<std::uint32_t>& boundary = stars.sample().boundary();
  const Sectors& sectors = stars.sample().sectors();
  auto all = ParallelGather<BoundarySimplex<K>>(
      boundary.size(), [&](std::size_t i, std::vector<BoundarySimplex<K>>* found) {
        const std::uint32_t p = boundary[i];
        const std::size_t first = found->size();
        for (int sector = 0; stars.has_star(p) && sector < sectors.Count(p); ++sector) {
          const auto& cell = stars.cell(p, sector);
          for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
            const auto face = stars.FaceSimplexOf(p, cell, v);
            if (CountWalls(face.walls) != 1 || face.fake || face.foreign || face.ids[0] != p ||
                sectors.Piece(p, sector, face.walls) == 0)
              continue;
            BoundarySimplex<K>& simplex = found->emplace_back();
            std::copy_n(face.ids.begin(), K, simplex.ids.begin());
            simplex.wall = std::countr_zero(face.walls);
            simplex.signs = sectors.SignsOf(p, sector) & ~face.walls;
            const auto [below, above] =
                sectors.labels().empty()
                    ? std::pair(0, 1)
                    : sectors.labels().Sides(face.walls, sectors.SignsOf(p, sector));
            SetSides<K>(stars.sample(), below, above, &simplex);
          }
        }
        // Both sides of a wall have it, and a cell that is far from convex may have it twice.
        const auto begin = found->begin() + static_cast<std::ptrdiff_t>(first);
        std::stable_sort(begin, found->end(),
                         [](const auto& a, const auto& b) { return a.ids < b.ids; });
        found->erase(std::unique(begin, found->end(),
                                 [](const auto& a, const auto& b) { return a.ids == b.ids; }),
                     found->end());
      });
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.ids < b.ids; });
  return all;
}

template <int K>
double MaxBoundaryNorm2(const Stars<K>& stars, std::uint32_t p) {
  double most2 = 0;
  const Sectors& sectors = stars.sample().sectors();
  for (int sector = 0; sector < sectors.Count(p) && stars.sample().walls(p) != 0; ++sector) {
    const auto& cell = stars.cell(p, sector);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v) {
      const WallSet walls = WallsAt<K>(cell, v);
      if (cell.norm2(v) > most2 && walls != 0 && sectors.Piece(p, sector, walls) != 0)
        most2 = cell.norm2(v);
    }
  }
  return most2;
}

template <int K>
void BoundaryMesh<K>::Update(const Stars<K>& stars, MeshDelta* delta) {
  std::vector<BoundarySimplex<K>> now = BoundarySimplices<K>(stars);
  const auto append = [](const BoundarySimplex<K>& simplex, std::vector<std::uint32_t>* to) {
    to->insert(to->end(), simplex.ids.begin(), simplex.ids.end());
  };
  // What has other labels now has gone, and come again.
  auto old = simplices_.begin();
  for (const BoundarySimplex<K>& simplex : now) {
    for (; old != simplices_.end() && old->ids < simplex.ids; ++old) append(*old, &delta->removed);
    const bool is_known = old != simplices_.end() && old->ids == simplex.ids;
    const bool is_same = is_known && old->behind == simplex.behind && old->ahead == simplex.ahead;
    if (is_known && !is_same) append(*old, &delta->removed);
    if (is_known) ++old;
    if (is_same) continue;
    append(simplex, &delta->added);
    delta->labels.insert(delta->labels.end(), {simplex.behind, simplex.ahead});
  }
  for (; old != simplices_.end(); ++old) append(*old, &delta->removed);
  simplices_ = std::move(now);
}

template <int K>
std::vector<std::uint32_t> BoundaryMesh<K>::Simplices() const {
  std::vector<std::uint32_t> ids;
  for (const BoundarySimplex<K>& simplex : simplices_)
    ids.insert(ids.end(), simplex.ids.begin(), simplex.ids.end());
  return ids;
}

template <int K>
std::vector<std::int8_t> BoundaryMesh<K>::Labels() const {
  std::vector<std::int8_t> labels;
  for (const BoundarySimplex<K>& simplex : simplices_)
    labels.insert(labels.end(), {simplex.behind, simplex.ahead});
  return labels;
}

STELLATE_INSTANTIATE_CLASS(BoundaryMesh)
#define STELLATE_EACH(K)                                                              \
  template std::vector<BoundarySimplex<K>> BoundarySimplices<K>(const Stars<K>&);     \
  template void ConormalsAt<K>(const Sample<K>&, const BoundarySimplex<K>&, double*); \
  template double MaxBoundaryNorm2<K>(const Stars<K>&, std::uint32_t);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
