#include "core/certificate/fibres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/certificate/small_solve.h"
#include "core/sample/random.h"

namespace stellate::core {
namespace {

constexpr double kBoundary = 1e-9;  // barycentric coordinates this small are left to rounding
constexpr double kSideStep = 0.02;  // of reach_out
constexpr int kSideSteps = 6;

}  // namespace

Fibres::Fibres(const MeshView& mesh, const Adjacency& adjacency, double max_diameter)
    : mesh_(mesh),
      adjacency_(adjacency),
      max_diameter_(max_diameter),
      coordinates_(mesh.points, mesh.points + mesh.vertices * static_cast<std::uint64_t>(mesh.d)),
      tree_(mesh.d, &coordinates_),
      place_(mesh.vertices, 0) {
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

void Fibres::Gather(const double* x, const double* tangent) {
  for (const NearVertex& v : near_) place_[v.id] = 0;
  near_.clear();
  // Simplices much larger than asked for are refused for their size; searching for them would turn
  // each sample into a search of the whole mesh.
  const double radius = (1 + kSideStep) * reach_out_ + std::min(max_diameter_, 4 * reach_out_);
  tree_.VisitNear(
      x, [&] { return radius; },
      [&](std::uint32_t v, double) {
        near_.push_back({v, {}});
      });
  for (std::size_t n = 0; n < near_.size(); ++n) {
    NearVertex& v = near_[n];
    place_[v.id] = static_cast<std::uint32_t>(n) + 1;
    const double* p = mesh_.points + std::size_t{v.id} * mesh_.d;
    for (int c = 0; c < mesh_.d; ++c) {
      for (int a = 0; a < mesh_.k; ++a) v.flat[a] += tangent[c * mesh_.k + a] * (p[c] - x[c]);
    }
  }
}

int Fibres::CountHits(const double* x, const double* tangent, double reach_out,
                      std::uint64_t random_key) {
  reach_out_ = reach_out;
  Gather(x, tangent);
  std::array<double, kMaxDimension> shift{};
  int hits = CountHitsBeside(x, shift);
  Random random(random_key, 0x66696272);
  for (int step = 0; hits < 0 && step < kSideSteps; ++step) {
    const double most = kSideStep * reach_out_ / std::sqrt(static_cast<double>(mesh_.k));
    for (int a = 0; a < mesh_.k; ++a) shift[a] = most * (2 * random.Uniform() - 1);
    hits = CountHitsBeside(x, shift);
  }
  return hits;
}

// Where the flat meets a simplex's hull, in barycentric coordinates: projected on the tangent
// space the flat is the point `shift`.
int Fibres::CountHitsBeside(const double* x, const std::array<double, kMaxDimension>& shift) const {
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
        may_hit = place_[ids[i]] != 0;
        if (may_hit) flat[i] = near_[place_[ids[i]] - 1].flat.data();
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
      if (lowest < -kBoundary || !IsWithinReach(x, ids, first, system.b)) continue;
      if (lowest <= kBoundary) return -1;
      ++hits;
    }
  }
  return hits;
}

bool Fibres::IsWithinReach(const double* x, const std::uint32_t* ids, double first,
                           const std::array<double, kMaxDimension>& others) const {
  const std::size_t d = static_cast<std::size_t>(mesh_.d);
  double squared = 0;
  for (std::size_t c = 0; c < d; ++c) {
    double y = first * mesh_.points[ids[0] * d + c];
    for (int i = 1; i <= mesh_.k; ++i) y += others[i - 1] * mesh_.points[ids[i] * d + c];
    squared += (y - x[c]) * (y - x[c]);
  }
  return squared <= reach_out_ * reach_out_;
}

}  // namespace stellate::core
