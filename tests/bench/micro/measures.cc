#include <benchmark/benchmark.h>

#include <array>
#include <vector>

#include "core/base/random.h"
#include "core/geometry/common_centre.h"
#include "core/geometry/simplex.h"
#include "tests/bench/micro/samples.h"

// What is measured of single simplices: size and shape, angle to a tangent space, common centre.

namespace stellate::core::bench {
namespace {

// A random J-simplex in R^d.
template <int J>
struct RandomSimplex {
  std::vector<double> coordinates;
  std::array<const double*, J + 1> vertices;

  explicit RandomSimplex(int d) : coordinates(static_cast<std::size_t>((J + 1) * d)) {
    Random random(3);
    for (double& x : coordinates) x = random.NearlyNormal();
    for (int i = 0; i <= J; ++i) {
      vertices[static_cast<std::size_t>(i)] = coordinates.data() + i * d;
    }
  }
};

template <int J>
void SimplexMeasure(benchmark::State& state) {
  const int d = static_cast<int>(state.range(0));
  const RandomSimplex<J> simplex(d);
  for (auto _ : state) benchmark::DoNotOptimize(MeasureSimplex(simplex.vertices, d));
}
BENCHMARK(SimplexMeasure<2>)->Arg(3)->Arg(9)->Arg(100);
BENCHMARK(SimplexMeasure<3>)->Arg(4)->Arg(9)->Arg(100);
BENCHMARK(SimplexMeasure<4>)->Arg(8);

template <int J>
void SimplexContainsSliver(benchmark::State& state) {
  const int d = static_cast<int>(state.range(0));
  const RandomSimplex<J> simplex(d);
  // So small that no face is a sliver, and all have to be looked at.
  for (auto _ : state) benchmark::DoNotOptimize(ContainsSliver(simplex.vertices, d, 1e-3));
}
BENCHMARK(SimplexContainsSliver<3>)->Arg(4)->Arg(9)->Arg(100);
BENCHMARK(SimplexContainsSliver<4>)->Arg(9);

template <int K>
void SimplexAngleToTangent(benchmark::State& state) {
  const int d = static_cast<int>(state.range(0));
  const RandomSimplex<K> simplex(d);
  std::vector<double> tangent(static_cast<std::size_t>(d * K), 0);
  for (std::size_t a = 0; a < K; ++a) tangent[a * static_cast<std::size_t>(d) + a] = 1;
  for (auto _ : state) {
    benchmark::DoNotOptimize(AngleToTangent(simplex.vertices, d, tangent.data(), K));
  }
}
BENCHMARK(SimplexAngleToTangent<2>)->Arg(3)->Arg(100);
BENCHMARK(SimplexAngleToTangent<3>)->Arg(9);

// Of simplices with vertices on a torus, in R^d.
template <int K, int D>
void SimplexCommonCentre(benchmark::State& state) {
  const FlatTorus<K, D> sample(K + 1);
  std::array<const double*, K + 1> points, tangents;
  const std::array<double, K + 1> weights{};
  for (int i = 0; i <= K; ++i) {
    points[static_cast<std::size_t>(i)] = sample.Point(i);
    tangents[static_cast<std::size_t>(i)] = sample.Tangent(i);
  }
  std::array<double, D> centre;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        CommonCentre<K>(D, points.data(), tangents.data(), weights.data(), 1e9, centre.data()));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(SimplexCommonCentre<2, 4>);
BENCHMARK(SimplexCommonCentre<3, 6>);
BENCHMARK(SimplexCommonCentre<3, 9>);
BENCHMARK(SimplexCommonCentre<3, 100>);
BENCHMARK(SimplexCommonCentre<4, 8>);

}  // namespace
}  // namespace stellate::core::bench
