#include "core/complex/stars.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/restricted_voronoi_cell.h"
#include "tests/bench/micro/samples.h"

// Restricted Voronoi cells: built from neighbours, asked whether a point would cut them, and whole
// stars of a sample.

namespace stellate::core::bench {
namespace {

// `n` half-spaces tangent to spheres of radius about 1: the neighbours of a well-sampled point.
template <int K>
struct HalfSpaces final : Surroundings<K> {
  std::vector<std::array<double, K>> normals;
  std::vector<double> offsets;

  explicit HalfSpaces(int n) {
    Random random(7);
    for (int i = 0; i < n; ++i) {
      std::array<double, K> normal;
      double norm2 = 0;
      for (double& x : normal) {
        x = random.NearlyNormal();
        norm2 += x * x;
      }
      const double length = (1.5 + random.Uniform()) / std::sqrt(norm2);
      for (double& x : normal) x *= length;
      normals.push_back(normal);
      offsets.push_back(0.5 * length * length * norm2);
    }
  }

  void Cut(RestrictedVoronoiCell<K>& cell,
           typename RestrictedVoronoiCell<K>::Scratch& scratch) const {
    cell.Reset(kInradius, *this);
    for (std::size_t i = 0; i < normals.size(); ++i) {
      cell.Clip(static_cast<std::uint32_t>(i), normals[i].data(), offsets[i], scratch, *this);
    }
  }

  double HalfSpace(std::uint32_t id, double* normal) const override {
    if (IsFake(id)) return FakeHalfSpace<K>(static_cast<int>(id - kFirstFakeId), kInradius, normal);
    std::copy_n(normals[id].data(), K, normal);
    return offsets[id];
  }
  int judged_in() const override { return 0; }
  bool Centre(const std::uint32_t*, std::uint64_t, double*, double*) const override {
    return false;
  }
  void Lift(const double*, double*) const override {}

 private:
  static constexpr double kInradius = 10;
};

template <int K>
void CellBuild(benchmark::State& state) {
  const HalfSpaces<K> neighbours(static_cast<int>(state.range(0)));
  RestrictedVoronoiCell<K> cell;
  typename RestrictedVoronoiCell<K>::Scratch scratch;
  for (auto _ : state) {
    neighbours.Cut(cell, scratch);
    benchmark::DoNotOptimize(cell.max_norm2());
  }
  state.counters["cell_vertices"] = static_cast<double>(cell.vertex_count());
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(CellBuild<1>)->Arg(8);
BENCHMARK(CellBuild<2>)->Arg(12)->Arg(24);
BENCHMARK(CellBuild<3>)->Arg(24)->Arg(48);
BENCHMARK(CellBuild<4>)->Arg(60);
BENCHMARK(CellBuild<5>)->Arg(100);

// One neighbour more, on a copy of a cell that is there: what a tentative insertion does.
template <int K>
void CellClipCopy(benchmark::State& state) {
  const HalfSpaces<K> neighbours(static_cast<int>(state.range(0)));
  RestrictedVoronoiCell<K> cell, copy;
  typename RestrictedVoronoiCell<K>::Scratch scratch;
  neighbours.Cut(cell, scratch);
  // Cuts the farthest vertex off, half-way.
  std::size_t farthest = 0;
  for (std::size_t v = 0; v < cell.vertex_count(); ++v)
    if (cell.norm2(v) > cell.norm2(farthest)) farthest = v;
  std::array<double, K> normal;
  std::copy_n(cell.x(farthest), K, normal.begin());
  const double offset = 0.9 * cell.norm2(farthest);
  for (auto _ : state) {
    copy = cell;
    benchmark::DoNotOptimize(copy.Clip(1000, normal.data(), offset, scratch, neighbours));
  }
}
BENCHMARK(CellClipCopy<2>)->Arg(12);
BENCHMARK(CellClipCopy<3>)->Arg(24);
BENCHMARK(CellClipCopy<4>)->Arg(60);

template <int K>
void CellWouldCut(benchmark::State& state) {
  const HalfSpaces<K> neighbours(static_cast<int>(state.range(0)));
  RestrictedVoronoiCell<K> cell;
  typename RestrictedVoronoiCell<K>::Scratch scratch;
  neighbours.Cut(cell, scratch);
  std::array<double, K> normal{};
  normal[0] = 1;
  // Beyond every vertex, so that all of them are looked at.
  double offset = 1 + std::sqrt(cell.max_norm2());
  for (auto _ : state) {
    benchmark::DoNotOptimize(offset);
    benchmark::DoNotOptimize(cell.WouldCut(normal.data(), offset));
  }
}
BENCHMARK(CellWouldCut<2>)->Arg(12);
BENCHMARK(CellWouldCut<3>)->Arg(24);
BENCHMARK(CellWouldCut<4>)->Arg(60);

// The mesher inserts a round at a time; so does this, doubling the sample each time.
template <int K, CentreRule kCentreRule>
void StarsCommit(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const FlatTorus<K> sample(n);
  for (auto _ : state) {
    Stars<K> stars(2 * K, 0.2, {1.0, kCentreRule});
    for (int begin = 0, end = 32; begin < n; begin = end, end = std::min(n, 2 * end)) {
      for (int i = begin; i < end; ++i) stars.Add(sample.Point(i), sample.Tangent(i));
      benchmark::DoNotOptimize(stars.Commit());
    }
  }
  state.SetItemsProcessed(state.iterations() * n);
}
BENCHMARK(StarsCommit<2, CentreRule::kTangentSpace>)
    ->Arg(1'000)
    ->Arg(10'000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();
BENCHMARK(StarsCommit<3, CentreRule::kTangentSpace>)
    ->Arg(1'000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();
BENCHMARK(StarsCommit<3, CentreRule::kCommonCentre>)
    ->Arg(1'000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace stellate::core::bench
