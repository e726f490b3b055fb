#include "core/run/certification.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/base/parallel.h"
#include "core/boundary/boundary_mesh.h"
#include "core/boundary/faces.h"
#include "core/complex/consistency.h"
#include "core/complex/labels.h"

namespace stellate::core {
namespace {

// max R_p over the simplices that all stars agree on, squared: the others are not in the mesh.
template <int K>
double MaxLiveNorm2(const Stars<K>& stars, std::uint32_t p) {
  double most = 0;
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
    const auto& cell = stars.cell(p, sector);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v)
      if (cell.norm2(v) > most &&
          stars.sample().sectors().Piece(p, sector, WallsAt<K>(cell, v)) != 0)
        most = cell.norm2(v);
  }
  return most;
}

template <int K>
double MaxAgreedNorm2(const Stars<K>& stars, std::uint32_t p) {
  double most = 0;
  for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector) {
    const auto& cell = stars.cell(p, sector);
    for (std::size_t v = 0; v < cell.vertex_count(); ++v)
      if (cell.norm2(v) > most &&
          stars.sample().sectors().Piece(p, sector, WallsAt<K>(cell, v)) != 0 &&
          IsConsistent<K>(stars, p, v, sector))
        most = cell.norm2(v);
  }
  return most;
}

MeshView WithSimplices(MeshView mesh, const std::vector<std::uint32_t>& simplices,
                       const std::optional<BoundaryOfMesh>& boundary) {
  mesh.simplices = &simplices;
  if (!boundary) return mesh;
  mesh.walls = boundary->walls.data();
  mesh.outward = boundary->outward.data();
  mesh.faces = &boundary->faces;
  if (boundary->table) {
    mesh.table = boundary->table;
    mesh.labels = boundary->labels.data();
    mesh.signs = boundary->signs.data();
    mesh.one_sided = boundary->one_sided.data();
    mesh.corner_sectors = &boundary->corner_sectors;
  }
  if (!boundary->balls.empty()) mesh.protecting_radii2 = boundary->balls.data();
  return mesh;
}

}  // namespace

template <int K>
StarFacts FactsOf(Engine<K>& engine) {
  const Stars<K>& stars = engine.stars();
  StarFacts facts;
  facts.converged = true;
  facts.protection = engine.protection().delta();
  facts.centre_rule = engine.criteria().centre_rule;
  facts.lone_points = engine.boundary().lone_points();
  for (const auto& touch : engine.boundary().touches()) {
    facts.touches.points.insert(facts.touches.points.end(), touch.point.begin(), touch.point.end());
    facts.touches.walls.push_back(touch.walls);
  }
  facts.same_point = BoundaryState<K>::kSameCorner * engine.criteria().epsilon;
  const bool agreed = engine.filled().is_handed_out();
  const bool leaves_inside = engine.boundary().policy().LeavesInside();
  const bool has_labels = !stars.sample().sectors().labels().empty();
  std::vector<double> parts(ChunkCount(stars.size()), 0);
  ParallelChunks(stars.size(), [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    double most = 0;
    for (auto p = static_cast<std::uint32_t>(begin); p < end; ++p)
      most = std::max(most, leaves_inside ? MaxBoundaryNorm2<K>(stars, p)
                            : agreed      ? MaxAgreedNorm2<K>(stars, p)
                            : has_labels  ? MaxLiveNorm2<K>(stars, p)
                                          : stars.cell(p).max_norm2());
    parts[chunk] = most;
  });
  for (const double norm2 : parts)
    facts.max_circumradius = std::max(facts.max_circumradius, std::sqrt(norm2));
  if (engine.criteria().graded())
    facts.max_size_ratio = engine.sizes().MaxRadiusOverSize(stars, leaves_inside);
  return facts;
}

Certification::Certification(const Specification& spec, MeshView mesh,
                             std::vector<std::uint32_t> simplices, const StarFacts& facts,
                             KnownOfManifold known, std::optional<BoundaryOfMesh> boundary)
    : simplices_(std::move(simplices)),
      boundary_(std::move(boundary)),
      certifier_(Certifier::Create(spec, WithSimplices(mesh, simplices_, boundary_), facts,
                                   std::move(known))) {}

// Adds to the faces of one wall what the simplices that end there would tell.
template <int K>
void AddWhatIsKnown(const Stars<K>& stars, std::vector<FaceMesh>* faces) {
  const std::vector<BoundarySimplex<K>> known = BoundarySimplices<K>(stars);
  const auto stride = static_cast<std::size_t>(K) * static_cast<std::size_t>(stars.sample().d());
  for (FaceMesh& face : *faces) {
    if (face.dimension != K - 1) continue;
    const std::size_t count = face.simplices.size() / K;
    face.signs.resize(count);
    face.behind.resize(count);
    face.conormals.resize(count * stride);
    ParallelFor(count, [&](std::size_t s) {
      BoundarySimplex<K> simplex;
      std::copy_n(face.simplices.begin() + static_cast<std::ptrdiff_t>(s * K), K,
                  simplex.ids.begin());
      const auto at = std::lower_bound(known.begin(), known.end(), simplex,
                                       [](const auto& a, const auto& b) { return a.ids < b.ids; });
      if (at == known.end() || at->ids != simplex.ids) return;  // it has a vertex off the wall
      face.signs[s] = at->signs;
      face.behind[s] = at->behind;
      ConormalsAt<K>(stars.sample(), *at, face.conormals.data() + s * stride);
    });
  }
}

template <int K>
std::optional<BoundaryOfMesh> BoundaryOf(const Engine<K>& engine) {
  if (!engine.boundary().policy().TakesClearances()) return std::nullopt;
  const Stars<K>& stars = engine.stars();
  BoundaryOfMesh boundary;
  boundary.walls.resize(stars.size());
  boundary.outward.assign(std::size_t{stars.size()} * K, 0);
  for (std::uint32_t p = 0; p < stars.size(); ++p) {
    CheckInterruption(p);
    const Site site = stars.sample().At(p, 0);
    boundary.walls[p] = site.walls;
    const double* conormal = site.conormals;
    ForEachWall(site.walls, [&](int wall) {
      const double sign = IsSubset(SetOfWall(wall), site.reversed) ? -1 : 1;
      for (int a = 0; a < K; ++a)
        boundary.outward[std::size_t{p} * K + static_cast<std::size_t>(a)] += sign * *conormal++;
    });
  }
  if (const LabelTable& labels = stars.sample().sectors().labels(); !labels.empty()) {
    boundary.table = &labels;
    boundary.labels = LabelsOf(stars, engine.Simplices());
    for (std::uint32_t p = 0; p < stars.size(); ++p) {
      boundary.signs.push_back(stars.sample().sectors().Signs(p));
      boundary.one_sided.push_back(stars.sample().sectors().Count(p) == 1);
      if (stars.sample().Codimension(stars.sample().walls(p)) <= K) continue;
      for (int sector = 0; sector < stars.sample().sectors().Count(p); ++sector)
        boundary.corner_sectors[p].push_back(stars.sample().sectors().SignsOf(p, sector));
    }
  }
  boundary.faces = FacesOf<K>(engine.stars());
  if (engine.boundary().policy().LeavesInside()) AddWhatIsKnown<K>(stars, &boundary.faces);
  for (std::uint32_t p = 0; stars.sample().has_protecting_balls() && p < stars.size(); ++p)
    boundary.balls.push_back(stars.sample().ProtectingRadius2(p));
  return boundary;
}

#define STELLATE_EACH(K)                     \
  template StarFacts FactsOf<K>(Engine<K>&); \
  template std::optional<BoundaryOfMesh> BoundaryOf<K>(const Engine<K>&);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
