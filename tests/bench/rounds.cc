// Round trips, queries, vertices and quality against size, with plain and speculative runs:
//
//   rounds [MANIFOLD EPSILON [SEEDS]]
//
// Without arguments a table of manifolds and sizes. Rounds of the refinement and of the certificate
// are counted apart; the time is the mesher's own, one thread.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <string>

#include "tests/support/run_mesher.h"

namespace {

using stellate::core::Mesher;
using stellate::core::Phase;

struct Work {
  const char* manifold;
  double epsilon;
};

constexpr Work kTable[] = {
    {"sphere", 0.1},         {"sphere", 0.03},
    {"sphere", 0.0092},      {"torus:1:0.4", 0.05},
    {"torus:1:0.4", 0.0103}, {"tanglecube", 0.1},
    {"tanglecube", 0.03},    {"two-spheres", 0.013},
    {"rp2", 0.05},           {"clifford-torus", 0.05},
    {"flat-torus:3", 0.4},   {"flat-torus:3", 0.206},
    {"so3", 0.35},           {"so3", 0.2},
};

bool Run(const Work& work, bool ahead, std::uint64_t seed) {
  std::string error;
  const auto manifold = stellate::MakeManifold(work.manifold, &error);
  if (!manifold) {
    std::fprintf(stderr, "%s\n", error.c_str());
    return false;
  }
  stellate::core::Specification spec = stellate::testing::SpecificationFor(*manifold, work.epsilon);
  spec.seeds.resize(0, 0);
  spec.criteria.speculative = ahead;
  spec.random_seed = seed;
  spec.threads = 1;
  auto created = Mesher::Create(spec);
  if (!created) {
    std::fprintf(stderr, "%s\n", created.error().message.c_str());
    return false;
  }
  Mesher& mesher = **created;
  std::uint64_t rounds = 0, queries = 0;  // of the refinement
  double seconds = 0;
  while (const auto* batch = mesher.NextBatch()) {
    if (mesher.progress().phase != Phase::kCertifying) {
      ++rounds;
      queries += static_cast<std::uint64_t>(batch->size());
    }
    const auto answers = stellate::testing::AnswersOf(*manifold, *batch);
    const double begin = stellate::testing::ProcessorSeconds();
    if (auto delta = mesher.Absorb(answers); !delta) mesher.Fail(delta.error());
    seconds += stellate::testing::ProcessorSeconds() - begin;
  }
  const auto& report = mesher.report();
  const auto& certificate = report.certificate;
  const double vertices = static_cast<double>(report.counts.vertices);
  std::printf("%-16s %7g %-5s %4llu %8.0f %6llu + %llu %8.3f %7.2f %8.4f %7.2f  %s\n",
              work.manifold, work.epsilon, ahead ? "ahead" : "plain",
              static_cast<unsigned long long>(seed), vertices,
              static_cast<unsigned long long>(rounds),
              static_cast<unsigned long long>(report.counts.rounds - rounds),
              static_cast<double>(queries) / vertices, certificate.min_angle_degrees,
              certificate.min_fatness, seconds,
              certificate.certified ? "certified" : certificate.verdict.c_str());
  std::fflush(stdout);
  return certificate.certified;
}

}  // namespace

int main(int argc, char** argv) {
  std::printf("%-16s %7s %-5s %4s %8s %10s %8s %7s %8s %7s\n", "manifold", "epsilon", "", "seed",
              "vertices", "rounds", "queries", "angle", "fatness", "cpu s");
  const Work one{argc > 2 ? argv[1] : "", argc > 2 ? std::atof(argv[2]) : 0};
  const std::uint64_t seeds = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  bool good = true;
  for (const Work* work = argc > 2 ? &one : std::begin(kTable);
       work != (argc > 2 ? &one + 1 : std::end(kTable)); ++work)
    for (std::uint64_t seed = 1; seed <= seeds; ++seed)
      for (const bool ahead : {false, true}) good = Run(*work, ahead, seed) && good;
  return good ? 0 : 1;
}
