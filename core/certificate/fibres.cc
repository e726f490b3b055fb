#include "core/certificate/fibres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/certificate/small_solve.h"
#include "core/parallel.h"
#include "core/sample/ball_tree.h"
#include "core/sample/random.h"

namespace stellate::core {
namespace {

constexpr double kBoundary = 1e-9;  // barycentric coordinates this small are left to rounding
constexpr double kSideStep = 0.02;  // of reach_out
constexpr int kSideSteps = 6;

// The mesh's vertices are gone through in parts of so many.
constexpr std::uint32_t kPart = 1 << 15;

// visit(part, v) for each vertex of the mesh, part by part, in parallel.
template <typename Visit>
void ForEachVertex(const MeshView& mesh, const Visit& visit) {
  ParallelFor((mesh.vertices + kPart - 1) / kPart, [&](std::uint64_t part) {
    const std::uint64_t end = std::min<std::uint64_t>(mesh.vertices, (part + 1) * kPart);
    for (std::uint64_t v = part * kPart; v < end; ++v) {
      if (v % 4096 == 0 && IsInterrupted()) return;
      visit(part, static_cast<std::uint32_t>(v));
    }
  });
}

std::size_t PartCount(const MeshView& mesh) {
  return static_cast<std::size_t>((mesh.vertices + kPart - 1) / kPart);
}

// For each of these points, the nearest of each part, as far as `candidates(v, visit)` says that
// vertex v may be the nearest.
template <typename Candidates>
std::vector<NearestVertex> NearestOf(const MeshView& mesh, const std::vector<double>& points,
                                     const Candidates& candidates) {
  const std::size_t count = points.size() / static_cast<std::size_t>(mesh.d);
  constexpr double kFar = std::numeric_limits<double>::infinity();
  std::vector<std::vector<NearestVertex>> parts(PartCount(mesh));
  for (auto& part : parts) part.assign(count, {0, kFar});
  ForEachVertex(mesh, [&](std::uint64_t part, std::uint32_t v) {
    candidates(v, [&](std::uint32_t i) {
      const double squared =
          SquaredDistance(points.data() + std::size_t{i} * mesh.d, mesh.Point(v), mesh.d);
      NearestVertex& nearest = parts[part][i];
      if (squared < nearest.distance) nearest = {v, squared};
    });
  });
  std::vector<NearestVertex> all(count, {0, kFar});
  for (const auto& part : parts)
    for (std::size_t i = 0; i < count; ++i)
      if (part[i].distance < all[i].distance) all[i] = part[i];
  for (NearestVertex& nearest : all) nearest.distance = std::sqrt(nearest.distance);
  return all;
}

// A mesh vertex near x, its tangent coordinates relative to x.
struct NearVertex {
  std::uint32_t id = 0;
  std::array<double, kMaxDimension> flat{};
};

// One fibre and what of the mesh is near it.
class FibreCounter {
 public:
  FibreCounter(const MeshView& mesh, const Adjacency& adjacency, const Fibre& fibre,
               const std::vector<std::uint32_t>& near)
      : mesh_(mesh), adjacency_(adjacency), fibre_(fibre) {
    for (const std::uint32_t v : near) {
      NearVertex& n = near_.emplace_back();
      n.id = v;
      const double* p = mesh.Point(v);
      for (int a = 0; a < mesh.k; ++a)
        for (int c = 0; c < mesh.d; ++c)
          n.flat[a] += fibre.tangent[a * mesh.d + c] * (p[c] - fibre.x[c]);
    }
  }

  int Count() const {
    std::array<double, kMaxDimension> shift{};
    int hits = CountBeside(shift);
    Random random(fibre_.random_key, 0x66696272);
    for (int step = 0; hits < 0 && step < kSideSteps; ++step) {
      const double most = kSideStep * fibre_.reach_out / std::sqrt(static_cast<double>(mesh_.k));
      for (int a = 0; a < mesh_.k; ++a) shift[a] = most * (2 * random.Uniform() - 1);
      hits = CountBeside(shift);
    }
    return hits;
  }

 private:
  // The vertices are ascending.
  const NearVertex* Find(std::uint32_t id) const {
    const auto at = std::lower_bound(near_.begin(), near_.end(), id,
                                     [](const NearVertex& v, std::uint32_t x) { return v.id < x; });
    return at != near_.end() && at->id == id ? &*at : nullptr;
  }

  // Where the flat meets a simplex's hull, in barycentric coordinates: projected on the tangent
  // space the flat is the point `shift`.
  int CountBeside(const std::array<double, kMaxDimension>& shift) const {
    const int k = mesh_.k;
    const SimplexList& list = adjacency_.list();
    int hits = 0;
    std::array<const double*, kMaxDimension + 1> flat{};
    for (const NearVertex& v : near_) {
      for (const std::uint32_t s : adjacency_.Star(v.id)) {
        const std::uint32_t* ids = list[s];
        if (ids[0] != v.id) continue;  // each simplex once
        bool may_hit = true;
        for (int i = 0; i <= k && may_hit; ++i) {
          const NearVertex* corner = Find(ids[i]);
          may_hit = corner != nullptr;
          if (may_hit) flat[i] = corner->flat.data();
        }
        for (int a = 0; a < k && may_hit; ++a) {
          double low = flat[0][a], high = low;
          for (int i = 1; i <= k; ++i) {
            low = std::min(low, flat[i][a]);
            high = std::max(high, flat[i][a]);
          }
          const double slack = kBoundary * (high - low);
          may_hit = low - slack <= shift[a] && shift[a] <= high + slack;
        }
        if (!may_hit) continue;

        SmallSystem system;
        for (int r = 0; r < k; ++r) {
          for (int c = 0; c < k; ++c) system.a[r][c] = flat[c + 1][r] - flat[0][r];
          system.b[r] = shift[r] - flat[0][r];
        }
        if (system.Solve(k) == 0) continue;  // parallel to the flat: generic flats miss it
        double first = 1;
        double lowest = 1;
        for (int c = 0; c < k; ++c) {
          first -= system.b[c];
          lowest = std::min(lowest, system.b[c]);
        }
        lowest = std::min(lowest, first);
        if (lowest < -kBoundary || !IsWithinReach(ids, first, system.b)) continue;
        if (lowest <= kBoundary) return -1;
        ++hits;
      }
    }
    return hits;
  }

  // Is the simplex's point with these barycentric coordinates within reach_out of x?
  bool IsWithinReach(const std::uint32_t* ids, double first,
                     const std::array<double, kMaxDimension>& others) const {
    const std::size_t d = static_cast<std::size_t>(mesh_.d);
    double squared = 0;
    for (std::size_t c = 0; c < d; ++c) {
      double y = first * mesh_.points[ids[0] * d + c];
      for (int i = 1; i <= mesh_.k; ++i) y += others[i - 1] * mesh_.points[ids[i] * d + c];
      squared += (y - fibre_.x[c]) * (y - fibre_.x[c]);
    }
    return squared <= fibre_.reach_out * fibre_.reach_out;
  }

  const MeshView& mesh_;
  const Adjacency& adjacency_;
  const Fibre& fibre_;
  std::vector<NearVertex> near_;
};

}  // namespace

std::vector<NearestVertex> FindNearestVertices(const MeshView& mesh,
                                               const std::vector<double>& points, double near) {
  BallTree tree(mesh.d, &points);
  const std::size_t count = points.size() / static_cast<std::size_t>(mesh.d);
  for (std::size_t i = 0; i < count; ++i) tree.Insert(near);
  std::vector<NearestVertex> nearest = NearestOf(
      mesh, points,
      [&](std::uint32_t v, const auto& visit) { tree.ForEachInfluencing(mesh.Point(v), visit); });
  // Few or none: such a point is far from the whole mesh.
  std::vector<std::size_t> far;
  std::vector<double> far_points;
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isinf(nearest[i].distance)) continue;
    far.push_back(i);
    const double* x = points.data() + i * static_cast<std::size_t>(mesh.d);
    far_points.insert(far_points.end(), x, x + mesh.d);
  }
  if (far.empty()) return nearest;
  const std::vector<NearestVertex> found =
      NearestOf(mesh, far_points, [&](std::uint32_t, const auto& visit) {
        for (std::uint32_t i = 0; i < far.size(); ++i) visit(i);
      });
  for (std::size_t i = 0; i < far.size(); ++i) nearest[far[i]] = found[i];
  return nearest;
}

std::vector<int> CountHits(const MeshView& mesh, const Adjacency& adjacency, double max_diameter,
                           const std::vector<Fibre>& fibres) {
  std::vector<double> points;
  for (const Fibre& f : fibres) points.insert(points.end(), f.x, f.x + mesh.d);
  BallTree tree(mesh.d, &points);
  for (const Fibre& f : fibres) {
    // Simplices much larger than asked for are refused for their size; searching for them would
    // turn each sample into a search of the whole mesh.
    tree.Insert((1 + kSideStep) * f.reach_out + std::min(max_diameter, 4 * f.reach_out));
  }
  struct Pair {
    std::uint32_t fibre, vertex;
  };
  std::vector<std::vector<Pair>> parts(PartCount(mesh));
  ForEachVertex(mesh, [&](std::uint64_t part, std::uint32_t v) {
    tree.ForEachInfluencing(mesh.Point(v), [&](std::uint32_t i) { parts[part].push_back({i, v}); });
  });
  std::vector<std::vector<std::uint32_t>> near(fibres.size());
  for (const auto& part : parts)
    for (const Pair& pair : part) near[pair.fibre].push_back(pair.vertex);
  std::vector<int> hits(fibres.size());
  ParallelFor(fibres.size(), [&](std::size_t i) {
    hits[i] = FibreCounter(mesh, adjacency, fibres[i], near[i]).Count();
  });
  return hits;
}

}  // namespace stellate::core
