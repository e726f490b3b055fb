// Samples of known manifolds, and what four programs make of the same points: prints a table,
// asserts nothing.
//
//   clouds [--seeds N] [--first SEED] [--only REGEX]
//
// --only: of lines, as "torus uniform, noise 0.1 | GUDHI". Seconds are of the processor, one
// thread. A mesh is right if it is a closed manifold with the topology of the sample's, counted by
// code that no program has a part in, and if GUDHI finds the manifold's homology mod 2 in it;
// CGAL's Poisson reconstruction puts its own vertices where it likes. "Said so": of our meshes,
// those that are certified.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

#include "core/reconstruction.h"
#include "tests/bench/clouds/reconstruct.h"
#include "tests/bench/peers/meter.h"
#include "tests/reconstruction/judge.h"

namespace stellate::bench {

Reconstructed ReconstructWithStellate(const testing::Sample& sample) {
  core::ReconstructionSpecification spec;
  spec.dimension = sample.k;
  spec.ambient_dimension = sample.d;
  Reconstructed made;
  const double before = ProcessorSeconds();
  auto result = core::Reconstruct(spec, {sample.points, {}}, {.threads = 1});
  made.seconds = ProcessorSeconds() - before;
  made.vertices = static_cast<std::uint32_t>(sample.points.cols());
  if (!result) return made;
  made.vertices += static_cast<std::uint32_t>(result->added.cols());
  made.simplices = std::move(result->simplices);
  made.certified = result->report.certificate.certified;
  return made;
}

namespace {

struct Program {
  const char* name;
  Reconstruct run;
};

constexpr Program kPrograms[] = {{"Stellate", ReconstructWithStellate},
                                 {"CGAL, advancing front", ReconstructWithFront},
                                 {"CGAL, Poisson", ReconstructWithPoisson},
                                 {"GUDHI, tangential complex", ReconstructWithTangential}};

struct Tally {
  int runs = 0, right = 0, said_so = 0, wrongly = 0;
  double seconds = 0, points = 0;
};

void Run(const testing::NamedRequest& kind, const Program& program, std::uint64_t seed,
         Tally* tally) {
  testing::SampleRequest request = kind.request;
  request.seed = seed;
  const testing::Sample sample = testing::Draw(request);
  Reconstructed made;
  try {
    made = program.run(sample);
  } catch (const std::exception& error) {
    std::printf("%s, seed %d, %s: %s\n", kind.name.c_str(), static_cast<int>(seed), program.name,
                error.what());
  }
  if (!made.applies) return;
  const bool right =
      testing::IsRight(testing::Count(sample.k, made.simplices, made.vertices), sample) &&
      testing::HasHomologyOf(sample, made.simplices);
  ++tally->runs;
  tally->right += right;
  tally->said_so += made.certified;
  tally->wrongly += made.certified && !right;
  tally->seconds += made.seconds;
  tally->points += static_cast<double>(sample.points.cols());
}

void RunAll(std::uint64_t first, std::uint64_t seeds, const std::regex& only) {
  std::printf("| Sample | Program | runs | right | said so | said so wrongly | us a point |\n");
  std::printf("|---|---|--:|--:|--:|--:|--:|\n");
  for (const testing::NamedRequest& kind : testing::GoodSamples()) {
    if (kind.request.manifold == "circle" || kind.request.manifold == "knot") continue;  // no peer
    for (const Program& program : kPrograms) {
      if (!std::regex_search(kind.name + " | " + program.name, only)) continue;
      Tally tally;
      for (std::uint64_t seed = first; seed < first + seeds; ++seed)
        Run(kind, program, seed, &tally);
      if (tally.runs == 0) continue;
      std::printf("| %s | %s | %d | %d | %d | %d | %.1f |\n", kind.name.c_str(), program.name,
                  tally.runs, tally.right, tally.said_so, tally.wrongly,
                  1e6 * tally.seconds / tally.points);
      std::fflush(stdout);
    }
  }
}

int Main(int count, char** arguments) {
  std::uint64_t seeds = 5, first = 1;
  std::regex only("");
  for (int i = 1; i < count; i += 2) {
    const std::string_view argument = arguments[i];
    if (i + 1 == count) return 2;
    if (argument == "--seeds")
      seeds = std::strtoull(arguments[i + 1], nullptr, 10);
    else if (argument == "--first")
      first = std::strtoull(arguments[i + 1], nullptr, 10);
    else if (argument == "--only")
      only = arguments[i + 1];
    else
      return 2;
  }
  RunAll(first, seeds, only);
  return 0;
}

}  // namespace
}  // namespace stellate::bench

int main(int count, char** arguments) {
  const int status = stellate::bench::Main(count, arguments);
  if (status != 0) std::fprintf(stderr, "clouds [--seeds N] [--first SEED] [--only REGEX]\n");
  return status;
}
