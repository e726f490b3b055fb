#include "core/certificate/fibres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/certificate/small_solve.h"
#include "core/sample/random.h"
#include "core/sample/vector_ops.h"

namespace stellate::core {
namespace {

constexpr double kBoundary = 1e-9;  // barycentric coordinates this small are left to rounding
constexpr double kSideStep = 0.02;  // of reach_out
constexpr int kSideSteps = 6;

}  // namespace

Fibres::Fibres(const MeshView& mesh, const Adjacency& adjacency, double reach_out,
               double max_diameter)
    : mesh_(mesh),
      adjacency_(adjacency),
      reach_out_(reach_out),
      // Simplices much larger than asked for are refused for their size; searching for them would
      // turn each sample into a search of the whole mesh.
      search_radius_((1 + kSideStep) * reach_out + std::min(max_diameter, 4 * reach_out)),
      coordinates_(mesh.points, mesh.points + mesh.vertices * static_cast<std::uint64_t>(mesh.d)),
      tree_(mesh.d, &coordinates_) {
  for (std::uint64_t v = 0; v < mesh.vertices; ++v) tree_.Insert(0);
}

Fibres::Nearest Fibres::NearestVertex(const double* x) const {
  Nearest nearest;
  double best = std::numeric_limits<double>::infinity();
  tree_.VisitNear(
      x, [&] { return std::sqrt(best); },
      [&](std::uint32_t v, double squared) {
        if (squared < best || (squared == best && v < nearest.vertex)) {
          best = squared;
          nearest.vertex = v;
        }
      });
  nearest.distance = std::sqrt(best);
  return nearest;
}

int Fibres::CountHits(const double* x, const double* tangent, std::uint64_t random_key) const {
  std::vector<std::uint32_t> nearby;
  tree_.VisitNear(
      x, [&] { return search_radius_; },
      [&](std::uint32_t v, double) {
        const auto star = adjacency_.Star(v);
        nearby.insert(nearby.end(), star.begin(), star.end());
      });
  std::sort(nearby.begin(), nearby.end());
  nearby.erase(std::unique(nearby.begin(), nearby.end()), nearby.end());

  int hits = CountHitsOnce(x, tangent, nearby);
  Random random(random_key, 0x66696272);
  std::vector<double> aside(x, x + mesh_.d);
  for (int step = 0; hits < 0 && step < kSideSteps; ++step) {
    std::copy(x, x + mesh_.d, aside.begin());
    for (int a = 0; a < mesh_.k; ++a) {
      const double u =
          kSideStep * reach_out_ * (2 * random.Uniform() - 1) / std::sqrt(double(mesh_.k));
      for (int i = 0; i < mesh_.d; ++i) aside[i] += u * tangent[i * mesh_.k + a];
    }
    hits = CountHitsOnce(aside.data(), tangent, nearby);
  }
  return hits;
}

int Fibres::CountHitsOnce(const double* x, const double* tangent,
                          const std::vector<std::uint32_t>& nearby) const {
  const int k = mesh_.k;
  const int d = mesh_.d;
  const SimplexList& list = adjacency_.list();
  int hits = 0;
  std::array<std::array<double, kMaxDimension>, kMaxDimension + 1> flat{};
  for (const std::uint32_t s : nearby) {
    // Where the flat meets the simplex's hull, in barycentric coordinates: projected on the
    // tangent space the flat is the origin.
    double diameter2 = 0;
    double nearest2 = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= k; ++i) {
      const double* v = mesh_.points + std::size_t{list[s][i]} * d;
      flat[i].fill(0);
      for (int c = 0; c < d; ++c) {
        for (int a = 0; a < k; ++a) flat[i][a] += tangent[c * k + a] * (v[c] - x[c]);
      }
      nearest2 = std::min(nearest2, Dot(flat[i].data(), flat[i].data(), k));
      for (int j = 0; j < i; ++j) {
        diameter2 = std::max(diameter2, SquaredDistance(flat[i].data(), flat[j].data(), k));
      }
    }
    if (nearest2 > diameter2) continue;
    SmallSystem system;
    for (int r = 0; r < k; ++r) {
      for (int c = 0; c < k; ++c) system.a[r][c] = flat[c + 1][r] - flat[0][r];
      system.b[r] = -flat[0][r];
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

    double squared = 0;
    for (int c = 0; c < d; ++c) {
      double y = first * mesh_.points[std::size_t{list[s][0]} * d + c];
      for (int i = 1; i <= k; ++i) {
        y += system.b[i - 1] * mesh_.points[std::size_t{list[s][i]} * d + c];
      }
      squared += (y - x[c]) * (y - x[c]);
    }
    if (squared > reach_out_ * reach_out_) continue;
    if (lowest <= kBoundary) return -1;
    ++hits;
  }
  return hits;
}

}  // namespace stellate::core
