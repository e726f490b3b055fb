#include <benchmark/benchmark.h>

#include <cmath>

#include "core/index/ball_tree.h"
#include "tests/bench/micro/samples.h"

// The ball tree against the size of the sample and the ambient dimension. A surface, so that what
// is found is the same in all of them.

namespace stellate::core::bench {
namespace {

// As many points find each other as influence each other in a mesh of n vertices.
double Radius(int n) { return 12 / std::sqrt(static_cast<double>(n)); }

template <int D>
struct Tree {
  FlatTorus<2, D> sample;
  BallTree tree;

  explicit Tree(int n) : sample(n), tree(D, &sample.points) {
    for (int i = 0; i < n; ++i) tree.Insert(Radius(n));
  }
};

// One query after the other, far apart.
int NextQuery(int query, int n) { return (query + 977) % n; }

template <int D>
void TreeInfluencing(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Tree<D> tree(n);
  std::size_t found = 0;
  int query = 0;
  for (auto _ : state) {
    tree.tree.ForEachInfluencing(tree.sample.Point(query), [&](std::uint32_t) { ++found; });
    query = NextQuery(query, n);
  }
  state.counters["found"] = static_cast<double>(found) / static_cast<double>(state.iterations());
}
BENCHMARK(TreeInfluencing<4>)->Arg(1'000)->Arg(100'000);
BENCHMARK(TreeInfluencing<10>)->Arg(100'000);
BENCHMARK(TreeInfluencing<30>)->Arg(100'000);
BENCHMARK(TreeInfluencing<100>)->Arg(100'000);

template <int D>
void TreeNear(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Tree<D> tree(n);
  const double radius = Radius(n);
  std::size_t found = 0;
  int query = 0;
  for (auto _ : state) {
    tree.tree.VisitNear(
        tree.sample.Point(query), [&] { return radius; }, [&](std::uint32_t, double) { ++found; });
    query = NextQuery(query, n);
  }
  state.counters["found"] = static_cast<double>(found) / static_cast<double>(state.iterations());
}
BENCHMARK(TreeNear<4>)->Arg(1'000)->Arg(100'000);
BENCHMARK(TreeNear<10>)->Arg(100'000);
BENCHMARK(TreeNear<30>)->Arg(100'000);
BENCHMARK(TreeNear<100>)->Arg(100'000);

template <int D>
void TreeInsert(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const FlatTorus<2, D> sample(n);
  for (auto _ : state) {
    BallTree tree(D, &sample.points);
    for (int i = 0; i < n; ++i) tree.Insert(Radius(n));
    benchmark::DoNotOptimize(tree.size());
  }
  state.SetItemsProcessed(state.iterations() * n);
}
BENCHMARK(TreeInsert<4>)->Arg(10'000)->Unit(benchmark::kMillisecond);
BENCHMARK(TreeInsert<30>)->Arg(10'000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stellate::core::bench
