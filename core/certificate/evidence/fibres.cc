#include "core/certificate/evidence/fibres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/base/infinity.h"
#include "core/base/parallel.h"
#include "core/base/random.h"
#include "core/base/vector_ops.h"
#include "core/certificate/complex/small_index.h"
#include "core/certificate/evidence/ball_grid.h"
#include "core/certificate/measure/small_solve.h"

namespace stellate::core {
namespace {

constexpr double kBoundary = 1e-9;  // barycentric coordinates this small are left to rounding
constexpr int kSideSteps = 6;

constexpr std::uint32_t kVerticesInPart = 1 << 15;

// Calls body(part, begin, end) for each part of the vertices, in parallel.
template <typename Body>
void ForEachPart(const MeshView& mesh, const Body& body) {
  ParallelFor((mesh.vertices + kVerticesInPart - 1) / kVerticesInPart, [&](std::uint64_t part) {
    const std::uint64_t end = std::min<std::uint64_t>(mesh.vertices, (part + 1) * kVerticesInPart);
    body(part, static_cast<std::uint32_t>(part * kVerticesInPart), static_cast<std::uint32_t>(end));
  });
}

std::size_t PartCount(const MeshView& mesh) {
  return static_cast<std::size_t>((mesh.vertices + kVerticesInPart - 1) / kVerticesInPart);
}

// One fibre and the simplices that may meet it: those with a vertex in `near` (ascending) no
// farther than `beside` from it.
class FibreCounter {
 public:
  FibreCounter(const MeshView& mesh, const VertexStars& stars, const Fibre& fibre,
               const std::vector<std::uint32_t>& near, double beside)
      : mesh_(mesh), stars_(stars), fibre_(fibre) {
    corner_index_.Clear(near.size());
    std::vector<std::uint32_t> close;
    for (const std::uint32_t v : near) {
      const double* flat = corners_[Corner(v)].data();
      if (Dot(flat, flat, mesh.k) <= beside * beside) close.push_back(v);
    }
    for (const std::uint32_t v : close) {
      for (const std::uint32_t s : stars.Star(v)) {
        const std::uint32_t* ids = stars.list()[s];
        int i = 0;
        while (!std::binary_search(close.begin(), close.end(), ids[i])) ++i;
        if (ids[i] != v) continue;  // each simplex once
        Candidate& candidate = candidates_.emplace_back();
        candidate.simplex = s;
        for (i = 0; i <= mesh.k; ++i) candidate.corners[i] = Corner(ids[i]);
      }
    }
  }

  FibreHits Count() const {
    Flat shift{};
    FibreHits hits = CountBeside(shift);
    Random random(fibre_.random_key, 0x66696272);
    for (int step = 0; hits.count < 0 && step < kSideSteps; ++step) {
      const double most = kSideStep * fibre_.reach_out / std::sqrt(static_cast<double>(mesh_.k));
      for (int a = 0; a < mesh_.k; ++a) shift[a] = most * (2 * random.Uniform() - 1);
      hits = CountBeside(shift);
    }
    return hits;
  }

 private:
  // Tangent coordinates relative to x.
  using Flat = std::array<double, kMaxDimension>;

  struct Candidate {
    std::uint32_t simplex = 0;
    std::array<std::uint32_t, kMaxDimension + 1> corners{};
  };

  std::uint32_t Corner(std::uint32_t v) {
    const std::uint32_t corner = corner_index_.Number(v);
    if (corner < corners_.size()) return corner;
    Flat& flat = corners_.emplace_back();
    offset_.resize(static_cast<std::size_t>(mesh_.d));
    for (int c = 0; c < mesh_.d; ++c) offset_[c] = mesh_.Point(v)[c] - fibre_.x[c];
    DotRows(fibre_.tangent, static_cast<std::size_t>(mesh_.k), offset_.data(), mesh_.d,
            flat.data());
    return corner;
  }

  // The point where the flat meets a simplex's hull, in barycentric coordinates: projected on the
  // tangent space the flat is the point `shift`.
  FibreHits CountBeside(const Flat& shift) const {
    const int k = mesh_.k;
    FibreHits hits;
    std::array<const double*, kMaxDimension + 1> flat{};
    for (const Candidate& candidate : candidates_) {
      const std::uint32_t* ids = stars_.list()[candidate.simplex];
      for (int i = 0; i <= k; ++i) flat[i] = corners_[candidate.corners[i]].data();
      bool may_hit = true;
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
      if (lowest < -kBoundary) continue;
      const double squared = SquaredDistance(ids, first, system.b);
      if (squared > fibre_.reach_out * fibre_.reach_out) continue;
      if (lowest <= kBoundary) return {-1, 0, 0};
      ++hits.count;
      if (hits.count == 1 || squared > hits.distance) {
        hits.distance = squared;
        hits.simplex = candidate.simplex;
      }
    }
    hits.distance = std::sqrt(hits.distance);
    return hits;
  }

  // The distance from x to the simplex's point with these barycentric coordinates.
  double SquaredDistance(const std::uint32_t* ids, double first, const Flat& others) const {
    const std::size_t d = static_cast<std::size_t>(mesh_.d);
    double squared = 0;
    for (std::size_t c = 0; c < d; ++c) {
      double y = first * mesh_.points[ids[0] * d + c];
      for (int i = 1; i <= mesh_.k; ++i) y += others[i - 1] * mesh_.points[ids[i] * d + c];
      squared += (y - fibre_.x[c]) * (y - fibre_.x[c]);
    }
    return squared;
  }

  const MeshView& mesh_;
  const VertexStars& stars_;
  const Fibre& fibre_;
  std::vector<Candidate> candidates_;
  SmallIndex corner_index_;
  std::vector<Flat> corners_;   // by number
  std::vector<double> offset_;  // d
};

}  // namespace

std::vector<NearestVertex> FindNearestVertices(const MeshView& mesh,
                                               const std::vector<double>& points, double near) {
  const std::size_t d = static_cast<std::size_t>(mesh.d);
  std::vector<NearestVertex> nearest(points.size() / d, {0, kInfinity});
  std::vector<std::size_t> sought(nearest.size());
  std::iota(sought.begin(), sought.end(), std::size_t{0});
  if (!(near > 0)) near = kInfinity;
  // Few points are left after the first pass: those far from the mesh.
  for (bool last = false; !sought.empty() && !last; near *= 4) {
    last = std::isinf(near);
    std::vector<double> centres;
    for (const std::size_t i : sought)
      centres.insert(centres.end(), points.data() + i * d, points.data() + (i + 1) * d);
    const BallGrid balls(mesh.d, centres.data(), std::vector<double>(sought.size(), near));
    std::vector<std::vector<NearestVertex>> parts(PartCount(mesh));
    ForEachPart(mesh, [&](std::uint64_t part, std::uint32_t begin, std::uint32_t end) {
      parts[part].assign(sought.size(), {0, kInfinity});
      NearestVertex* const best = parts[part].data();
      for (std::uint32_t v = begin; v < end; ++v) {
        if (v % 4096 == 0 && IsInterrupted()) return;
        balls.ForEachAround(mesh.Point(v), [&](std::uint32_t i, double squared) {
          if (squared < best[i].distance) best[i] = {v, squared};
        });
      }
    });
    std::vector<std::size_t> still;
    for (std::size_t n = 0; n < sought.size(); ++n) {
      NearestVertex best{0, kInfinity};
      for (const auto& part : parts)
        if (part[n].distance < best.distance) best = part[n];
      if (std::isinf(best.distance))
        still.push_back(sought[n]);
      else
        nearest[sought[n]] = {best.vertex, std::sqrt(best.distance)};
    }
    sought = std::move(still);
  }
  return nearest;
}

std::vector<FibreHits> CountHits(const MeshView& mesh, const VertexStars& stars,
                                 double max_diameter, const std::vector<Fibre>& fibres) {
  // Each point of a simplex has a vertex within this share of its diameter (Jung).
  const double jung = std::sqrt(mesh.k / (2.0 * (mesh.k + 1)));
  std::vector<double> points, radii, beside;
  for (const Fibre& f : fibres) {
    points.insert(points.end(), f.x, f.x + mesh.d);
    // Simplices much larger than the size bound are refused anyway; searching for them would make
    // each sample a search of the whole mesh.
    const double to_vertex = jung * std::min(max_diameter, 4 * f.reach_out);
    radii.push_back((1 + kSideStep) * f.reach_out + to_vertex);
    beside.push_back(2 * kSideStep * f.reach_out + to_vertex);
  }
  const BallGrid balls(mesh.d, points.data(), std::move(radii));
  struct Pair {
    std::uint32_t fibre, vertex;
  };
  std::vector<std::vector<Pair>> parts(PartCount(mesh));
  ForEachPart(mesh, [&](std::uint64_t part, std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t v = begin; v < end; ++v) {
      if (v % 4096 == 0 && IsInterrupted()) return;
      balls.ForEachAround(mesh.Point(v), [&](std::uint32_t i, double) {
        parts[part].push_back({i, v});
      });
    }
  });
  std::vector<std::vector<std::uint32_t>> near(fibres.size());
  for (const auto& part : parts)
    for (const Pair& pair : part) near[pair.fibre].push_back(pair.vertex);
  std::vector<FibreHits> hits(fibres.size());
  ParallelFor(fibres.size(), [&](std::size_t i) {
    hits[i] = FibreCounter(mesh, stars, fibres[i], near[i], beside[i]).Count();
  });
  return hits;
}

}  // namespace stellate::core
