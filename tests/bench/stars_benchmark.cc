#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/complex/star_complex.h"
#include "core/geometry/restricted_voronoi_cell.h"
#include "core/geometry/simplex.h"
#include "core/sample/ball_tree.h"
#include "core/sample/random.h"

// The inner loops: clipping a cell, searching the sample, building stars, measuring a simplex.

namespace stellate::core {
namespace {

// `n` half-spaces tangent to spheres of radius about 1: the neighbours of a well-sampled point.
template <int K>
struct HalfSpaces {
  std::vector<std::array<double, K>> normals;
  std::vector<double> offsets;

  explicit HalfSpaces(int n) {
    Random random(7);
    for (int i = 0; i < n; ++i) {
      std::array<double, K> normal;
      double norm2 = 0;
      for (double& x : normal) {
        x = random.Normal();
        norm2 += x * x;
      }
      const double length = (1.5 + random.Uniform()) / std::sqrt(norm2);
      for (double& x : normal) x *= length;
      normals.push_back(normal);
      offsets.push_back(0.5 * length * length * norm2);
    }
  }
};

template <int K>
void BuildCell(benchmark::State& state) {
  const HalfSpaces<K> neighbours(static_cast<int>(state.range(0)));
  RestrictedVoronoiCell<K> cell;
  typename RestrictedVoronoiCell<K>::Scratch scratch;
  std::size_t vertices = 0;
  for (auto _ : state) {
    cell.Reset(10);
    for (std::size_t i = 0; i < neighbours.normals.size(); ++i) {
      cell.Clip(static_cast<std::uint32_t>(i), neighbours.normals[i].data(),
                neighbours.offsets[i], scratch);
    }
    vertices += cell.vertices().size();
  }
  state.counters["cell_vertices"] =
      static_cast<double>(vertices) / static_cast<double>(state.iterations());
}
BENCHMARK(BuildCell<1>)->Arg(8);
BENCHMARK(BuildCell<2>)->Arg(12)->Arg(24);
BENCHMARK(BuildCell<3>)->Arg(24)->Arg(48);
BENCHMARK(BuildCell<4>)->Arg(60);

// A sample of the flat torus in R^(2K): rows of points, and their tangent bases.
template <int K>
struct FlatTorus {
  std::vector<double> points, tangents;

  explicit FlatTorus(int n) {
    Random random(11);
    for (int i = 0; i < n; ++i) {
      std::array<double, K> angle;
      for (double& a : angle) a = 2 * std::numbers::pi * random.Uniform();
      for (double a : angle) points.insert(points.end(), {std::cos(a), std::sin(a)});
      for (int row = 0; row < K; ++row) {
        for (int b = 0; b < K; ++b) {
          tangents.push_back(b == row ? -std::sin(angle[b]) : 0);
          tangents.push_back(b == row ? std::cos(angle[b]) : 0);
        }
      }
    }
  }
};

// The mesher inserts a round at a time; so does this, doubling the sample each time.
template <int K>
void BuildStars(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  constexpr int d = 2 * K;
  const FlatTorus<K> sample(n);
  for (auto _ : state) {
    StarComplex<K> complex(d, 0.2, 1.0);
    for (int begin = 0, end = 32; begin < n; begin = end, end = std::min(n, 2 * end)) {
      for (int i = begin; i < end; ++i) {
        complex.Append(&sample.points[static_cast<std::size_t>(i * d)],
                       &sample.tangents[static_cast<std::size_t>(i * d * K)]);
      }
      benchmark::DoNotOptimize(complex.Commit());
    }
  }
  state.SetItemsProcessed(state.iterations() * n);
}
BENCHMARK(BuildStars<2>)->Arg(1'000)->Arg(10'000)->Unit(benchmark::kMillisecond);
BENCHMARK(BuildStars<3>)->Arg(1'000)->Unit(benchmark::kMillisecond);

void SearchInfluencing(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const FlatTorus<2> sample(n);
  BallTree tree(4, &sample.points);
  for (int i = 0; i < n; ++i) tree.Insert(6.0 / std::sqrt(n));
  std::size_t found = 0, query = 0;
  for (auto _ : state) {
    tree.ForEachInfluencing(&sample.points[query], [&](std::uint32_t) { ++found; });
    query = (query + 4 * 977) % sample.points.size();
  }
  state.counters["found"] = static_cast<double>(found) / static_cast<double>(state.iterations());
}
BENCHMARK(SearchInfluencing)->Arg(1'000)->Arg(100'000);

void MeasureTetrahedron(benchmark::State& state) {
  const int d = static_cast<int>(state.range(0));
  Random random(3);
  std::vector<double> points(static_cast<std::size_t>(4 * d));
  for (double& x : points) x = random.Normal();
  const std::array<const double*, 4> vertices = {&points[0], &points[static_cast<std::size_t>(d)],
                                                 &points[static_cast<std::size_t>(2 * d)],
                                                 &points[static_cast<std::size_t>(3 * d)]};
  for (auto _ : state) benchmark::DoNotOptimize(MeasureSimplex(vertices, d));
}
BENCHMARK(MeasureTetrahedron)->Arg(3)->Arg(9)->Arg(100);

}  // namespace
}  // namespace stellate::core

BENCHMARK_MAIN();
