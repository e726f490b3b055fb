#include "core/certificate/measure/star_geometry.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "core/base/first_ids.h"
#include "core/base/instantiate.h"
#include "core/base/parallel.h"
#include "core/certificate/measure/star_measurer.h"
#include "core/report.h"

namespace stellate::core {
namespace {

// Of a whole mesh, as PartOfStars has them.
struct Numbers {
  std::uint64_t neighbours = 0, unused = 0;
};

template <int K>
StarGeometry RunSweep(Sweep& sweep, Numbers* numbers) {
  const MeshView& mesh = sweep.mesh;
  std::vector<PartOfStars> parts(ChunkCount(mesh.vertices));
  ParallelChunks(mesh.vertices, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    StarMeasurer<K>(sweep, &parts[chunk]).Run(begin, end);
  });
  StarGeometry whole;
  if (sweep.is_refuted) return whole;
  whole.reach = std::numeric_limits<double>::infinity();
  std::vector<ShapeSearch::Extremes> shapes;
  shapes.reserve(parts.size());
  for (PartOfStars& part : parts) {
    StarGeometry& stars = part.stars;
    if (stars.reach < whole.reach) {
      whole.reach = stars.reach;
      whole.narrowest_p = stars.narrowest_p;
      whole.narrowest_q = stars.narrowest_q;
    }
    if (whole.unembedded_stars == 0) whole.first_unembedded = std::move(stars.first_unembedded);
    whole.unembedded_stars += stars.unembedded_stars;
    AppendFirst(stars.some_unembedded, Violations::kMost, &whole.some_unembedded);
    shapes.push_back(part.shape);
    numbers->neighbours += part.neighbours;
    numbers->unused += part.unused;
  }
  whole.longest_edge = std::move(sweep.longest_edge);
  whole.shape = sweep.shape.Conclude(shapes);
  return whole;
}

StarGeometry MeasureBy(Sweep& sweep, Numbers* numbers) {
  sweep.longest_edge.assign(sweep.mesh.vertices, 0);
  return WithMeshDimension(sweep.mesh.k, [&](auto k) { return RunSweep<k()>(sweep, numbers); });
}

}  // namespace

StarGeometry MeasureStars(const MeshView& mesh, const Adjacency& adjacency,
                          std::span<const std::int8_t> orientation) {
  if (adjacency.bad_facets() > 0) orientation = {};
  Sweep sweep{mesh, adjacency, &adjacency, orientation, {mesh, adjacency.list()}, {}, {}};
  Numbers numbers;
  return MeasureBy(sweep, &numbers);
}

std::optional<EmbeddedStars> MeasureIfEmbedded(const MeshView& mesh, const VertexStars& stars) {
  if (mesh.k > kMostLocal || mesh.walls) return std::nullopt;
  const std::uint32_t simplices = stars.list().size();
  Sweep sweep{mesh, stars, nullptr, {}, {mesh, stars.list()}, {}, {}};
  sweep.sides.assign(simplices, 0);
  EmbeddedStars embedded;
  Numbers numbers;
  embedded.geometry = MeasureBy(sweep, &numbers);
  if (sweep.is_refuted) return std::nullopt;
  embedded.connectivity = ComputeConnectivity(stars.list(), sweep.sides);
  // V - E + F - ..., with k + 1 facets a simplex, each in two: V - E for a curve, V - E + F for
  // both a surface and a manifold of dimension 3.
  embedded.euler_characteristic = static_cast<std::int64_t>(mesh.vertices - numbers.unused) -
                                  static_cast<std::int64_t>(numbers.neighbours / 2) +
                                  (mesh.k > 1 ? std::int64_t{simplices} : 0);
  embedded.connectivity.components -= numbers.unused;
  return embedded;
}

}  // namespace stellate::core
