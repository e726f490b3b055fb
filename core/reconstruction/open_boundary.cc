#include "core/reconstruction/open_boundary.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <numeric>

#include "core/base/interruption.h"
#include "core/base/parallel.h"
#include "core/base/parallel_sort.h"
#include "core/base/vector_ops.h"
#include "core/certificate/complex/topology.h"
#include "core/geometry/simplex.h"
#include "core/specification.h"

namespace stellate::core {
namespace {

// Writes the direction in which the star of v lies, in its tangent coordinates.
void FindInward(const MeshView& mesh, const VertexStars& stars, std::uint32_t v, double* inward) {
  const auto d = static_cast<std::size_t>(mesh.d), k = static_cast<std::size_t>(mesh.k);
  std::vector<double> step(d);
  for (const std::uint32_t s : stars.Star(v)) {
    std::fill(step.begin(), step.end(), 0.0);
    for (std::size_t i = 0; i <= k; ++i)
      for (std::size_t c = 0; c < d; ++c)
        step[c] += mesh.Point(stars.list()[s][i])[c] - mesh.Point(v)[c];
    double along[kMaxDimension], length2 = 0;
    for (std::size_t a = 0; a < k; ++a) {
      along[a] = Dot(mesh.Tangent(v) + a * d, step.data(), mesh.d);
      length2 += along[a] * along[a];
    }
    if (!(length2 > 0)) continue;
    for (std::size_t a = 0; a < k; ++a) inward[a] += along[a] / std::sqrt(length2);
  }
}

// Removes the triangles at a vertex that are not in its largest fan; of equal ones the first stays.
// Returns whether there were any.
bool RemoveSmallFans(const VertexStars& stars, std::uint32_t v,
                     std::vector<std::uint8_t>* removed) {
  std::vector<std::uint32_t> star;
  for (const std::uint32_t s : stars.Star(v))
    if (!(*removed)[s]) star.push_back(s);
  if (star.size() < 2) return false;
  std::vector<std::size_t> up(star.size());
  std::iota(up.begin(), up.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (up[i] != i) i = up[i] = up[up[i]];
    return i;
  };
  std::map<std::uint32_t, std::size_t> seen;  // by the other end of an edge at v
  for (std::size_t m = 0; m < star.size(); ++m)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t q = stars.list()[star[m]][i];
      if (q == v) continue;
      const auto [at, fresh] = seen.emplace(q, m);
      if (fresh) continue;
      const std::size_t a = root(at->second), b = root(m);
      up[std::max(a, b)] = std::min(a, b);
    }
  std::map<std::size_t, std::size_t> sizes;
  for (std::size_t m = 0; m < star.size(); ++m) ++sizes[root(m)];
  const auto largest = std::max_element(
      sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  for (std::size_t m = 0; m < star.size(); ++m)
    if (root(m) != largest->first) (*removed)[star[m]] = 1;
  return sizes.size() > 1;
}

}  // namespace

OpenBoundary FindOpenBoundary(const MeshView& mesh) {
  OpenBoundary boundary;
  const auto k = static_cast<std::size_t>(mesh.k);
  const SimplexList list{mesh.k, static_cast<std::uint32_t>(mesh.vertices), mesh.simplices};
  if (list.size() == 0 || !CheckSimplexList(list).empty()) return boundary;
  const VertexStars stars(list);
  // By facet: its vertices and the simplex; those that come once.
  using Facet = std::array<std::uint32_t, kMaxDimension>;
  std::vector<Facet> facets(std::size_t{list.size()} * (k + 1), Facet{});
  ParallelFor(list.size(), [&](std::uint32_t s) {
    for (std::size_t i = 0; i <= k; ++i) {
      Facet& facet = facets[s * (k + 1) + i];
      std::size_t at = 0;
      for (std::size_t j = 0; j <= k; ++j)
        if (j != i) facet[at++] = list[s][j];
    }
  });
  ParallelSort(facets, std::less<>());
  FaceMesh face;
  face.walls = 1;
  face.dimension = mesh.k - 1;
  boundary.walls.assign(mesh.vertices, 0);
  boundary.outward.assign(mesh.vertices * k, 0.0);
  for (std::size_t i = 0; i < facets.size(); ++i) {
    CheckInterruption(i);
    if ((i > 0 && facets[i] == facets[i - 1]) ||
        (i + 1 < facets.size() && facets[i] == facets[i + 1]))
      continue;
    face.simplices.insert(face.simplices.end(), facets[i].begin(),
                          facets[i].begin() + static_cast<std::ptrdiff_t>(k));
  }
  if (face.simplices.empty()) return boundary;
  for (const std::uint32_t v : face.simplices) boundary.walls[v] = 1;
  ParallelFor(mesh.vertices, [&](std::uint64_t v) {
    if (boundary.walls[v] == 0) return;
    double* const outward = boundary.outward.data() + v * k;
    FindInward(mesh, stars, static_cast<std::uint32_t>(v), outward);
    for (std::size_t a = 0; a < k; ++a) outward[a] = -outward[a];
  });
  boundary.faces.push_back(std::move(face));
  return boundary;
}

void TrimBoundary(const FittedCloud& cloud, Assembly* assembly) {
  const auto width = static_cast<std::size_t>(cloud.k) + 1;
  const SimplexList list{cloud.k, cloud.size, &assembly->simplices};
  std::vector<std::uint8_t> removed(list.size());
  ParallelFor(list.size(), [&](std::uint32_t s) {
    const double* corners[kMaxDimension + 1];
    double open = 0;
    for (std::size_t i = 0; i < width; ++i) {
      corners[i] = cloud.Position(list[s][i]);
      open = std::max(open, OpenRadius(cloud, list[s][i]));
    }
    removed[s] = !(MeasureSimplex({corners, width}, cloud.d).circumradius <= open);
  });
  if (cloud.k == 2) {
    // What goes at one vertex may leave fans at another.
    const VertexStars stars(list);
    for (bool again = true; again;) {
      again = false;
      for (std::uint32_t v = 0; v < cloud.size; ++v) {
        CheckInterruption(v);
        again = RemoveSmallFans(stars, v, &removed) || again;
      }
    }
  }
  std::vector<std::uint32_t> left;
  for (std::uint32_t s = 0; s < list.size(); ++s)
    if (!removed[s]) left.insert(left.end(), list[s], list[s] + width);
  assembly->simplices = std::move(left);
}

}  // namespace stellate::core
