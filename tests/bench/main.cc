// Times everything that is timed but the peers: inner loops (micro/), whole meshes, queries shared
// out.
//
//   timings [OPTION]... [MANIFOLD EPSILON]...
//
// Options are Google Benchmark's; --benchmark_filter chooses by name. Manifolds that are named are
// meshed in place of the tables'. Ends with 1 where a mesh is not certified.

#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <vector>

#include "tests/bench/timings.h"

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  std::vector<stellate::bench::Work> asked;
  for (int i = 1; i < argc; i += 2) {
    const double epsilon = i + 1 < argc ? std::atof(argv[i + 1]) : 0;
    if (epsilon <= 0 || argv[i][0] == '-') {
      std::fprintf(stderr, "timings: '%s' is no option, and no manifold with its epsilon\n",
                   argv[i]);
      return 2;
    }
    asked.push_back({argv[i], epsilon});
  }
  try {
    stellate::bench::RegisterMeshes(asked);
    stellate::bench::RegisterChunks(asked);
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "timings: %s\n", failure.what());
    return 2;
  }
  benchmark::Shutdown();
  return stellate::bench::AllMeshesAreRight() ? 0 : 1;
}
