// What the certificate costs beside the mesh: the mesher's own time, one thread, and queries.
//
//   certificate [MANIFOLD EPSILON [RUNS]]
//
// The best of several runs. The round that ends the refinement and begins the certificate is
// counted with the certificate.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <string>

#include "tests/support/run_mesher.h"

namespace {

using stellate::core::Mesher;
using stellate::core::Phase;

struct Work {
  const char* manifold;
  double epsilon;
};

constexpr Work kTable[] = {{"torus:1:0.4", 0.02}, {"sphere:3:4", 0.2}, {"so3", 0.25}};

struct Cost {
  double seconds = std::numeric_limits<double>::infinity();
  std::uint64_t queries = 0;
};

bool Run(const Work& work, int runs) {
  std::string error;
  const auto manifold = stellate::MakeManifold(work.manifold, &error);
  if (!manifold) {
    std::fprintf(stderr, "%s\n", error.c_str());
    return false;
  }
  auto spec = stellate::testing::SpecificationFor(*manifold, work.epsilon);
  spec.random_seed = 1;
  spec.threads = 1;
  Cost refinement, certificate;
  bool certified = true;
  unsigned long long vertices = 0;
  for (int n = 0; n < runs; ++n) {
    auto created = Mesher::Create(spec);
    if (!created) {
      std::fprintf(stderr, "%s\n", created.error().message.c_str());
      return false;
    }
    Mesher& mesher = **created;
    Cost first{0, 0}, then{0, 0};
    while (const auto* batch = mesher.NextBatch()) {
      const bool certifying = mesher.progress().phase == Phase::kCertifying;
      (certifying ? then : first).queries += static_cast<std::uint64_t>(batch->size());
      const auto answers = stellate::testing::AnswersOf(*manifold, *batch);
      const double begin = stellate::testing::ProcessorSeconds();
      if (auto delta = mesher.Absorb(answers); !delta) mesher.Fail(delta.error());
      const double took = stellate::testing::ProcessorSeconds() - begin;
      const bool begun = mesher.progress().phase == Phase::kCertifying;
      (certifying || begun ? then : first).seconds += took;
    }
    refinement = {std::min(refinement.seconds, first.seconds), first.queries};
    certificate = {std::min(certificate.seconds, then.seconds), then.queries};
    certified = mesher.report().certificate.certified;
    vertices = mesher.report().counts.vertices;
  }
  std::printf("%-16s %7g %8llu %10.4f %8llu %12.4f %8llu  %s\n", work.manifold, work.epsilon,
              vertices, refinement.seconds, static_cast<unsigned long long>(refinement.queries),
              certificate.seconds, static_cast<unsigned long long>(certificate.queries),
              certified ? "certified" : "refused");
  std::fflush(stdout);
  return certified;
}

}  // namespace

int main(int argc, char** argv) {
  std::printf("%-16s %7s %8s %10s %8s %12s %8s\n", "manifold", "epsilon", "vertices", "refine, s",
              "queries", "certify, s", "queries");
  const Work one{argc > 2 ? argv[1] : "", argc > 2 ? std::atof(argv[2]) : 0};
  const int runs = argc > 3 ? std::atoi(argv[3]) : 5;
  bool good = true;
  for (const Work* work = argc > 2 ? &one : std::begin(kTable);
       work != (argc > 2 ? &one + 1 : std::end(kTable)); ++work)
    good = Run(*work, runs) && good;
  return good ? 0 : 1;
}
