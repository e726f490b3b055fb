// The mesher on one core and on several: time, what of it is serial, and whether the mesh is the
// same, bit for bit.
//
//   threads [MANIFOLD EPSILON]
//
// The time is the mesher's own by the clock, the best of three runs. From T(n) on n cores follows
// the serial share s of Amdahl's law, T(n) = T(1) (s + (1 - s) / n), and what it lets 64 cores
// gain.

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "core/base/random.h"
#include "tests/support/run_mesher.h"

namespace {

using stellate::core::Mesher;
using stellate::core::Mix64;

struct Work {
  const char* manifold;
  double epsilon;
};

constexpr Work kTable[] = {
    {"sphere", 0.0092}, {"torus:1:0.4", 0.0103}, {"torus:1:0.4", 0.0033}, {"flat-torus:3", 0.206},
    {"so3", 0.2},
};
constexpr int kRuns = 3;
constexpr std::uint64_t kMostVertices = 100'000'000;

struct Outcome {
  double seconds = 0;
  std::uint64_t vertices = 0, fingerprint = 0;
  bool certified = false;
};

// Of all coordinates and simplices.
std::uint64_t Fingerprint(const Mesher& mesher) {
  std::uint64_t sum = 0;
  const Eigen::MatrixXd points = mesher.Points();
  for (const double x : points.reshaped()) sum = Mix64(sum ^ std::bit_cast<std::uint64_t>(x));
  for (const std::uint32_t id : mesher.Simplices()) sum = Mix64(sum ^ id);
  return sum;
}

Outcome Run(stellate::Manifold& manifold, double epsilon, int threads) {
  stellate::core::Specification spec = stellate::testing::SpecificationFor(manifold, epsilon);
  spec.threads = threads;
  spec.limits.max_vertices = kMostVertices;
  auto created = Mesher::Create(spec);
  if (!created) {
    std::fprintf(stderr, "%s\n", created.error().message.c_str());
    std::exit(1);
  }
  Mesher& mesher = **created;
  Outcome outcome;
  while (const auto* batch = mesher.NextBatch()) {
    const auto answers = stellate::testing::AnswersOf(manifold, *batch);
    const auto begin = std::chrono::steady_clock::now();
    if (auto delta = mesher.Absorb(answers); !delta) mesher.Fail(delta.error());
    outcome.seconds +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  outcome.vertices = mesher.report().counts.vertices;
  outcome.certified = mesher.report().certificate.certified;
  outcome.fingerprint = Fingerprint(mesher);
  return outcome;
}

Outcome Best(stellate::Manifold& manifold, double epsilon, int threads) {
  Outcome best = Run(manifold, epsilon, threads);
  for (int run = 1; run < kRuns; ++run)
    best.seconds = std::min(best.seconds, Run(manifold, epsilon, threads).seconds);
  return best;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<Work> works(std::begin(kTable), std::end(kTable));
  if (argc > 2) works = {{argv[1], std::atof(argv[2])}};
  const int cores = std::max(2, static_cast<int>(std::thread::hardware_concurrency()));
  std::printf("%-14s %7s %9s %7s %9s %6s %8s %9s  %s\n", "manifold", "epsilon", "vertices",
              "threads", "seconds", "gain", "serial", "64 cores", "mesh");
  bool good = true;
  for (const Work& work : works) {
    std::string error;
    const auto manifold = stellate::MakeManifold(work.manifold, &error);
    if (!manifold) {
      std::fprintf(stderr, "%s\n", error.c_str());
      return 2;
    }
    const Outcome one = Best(*manifold, work.epsilon, 1);
    std::printf("%-14s %7g %9llu %7d %9.3f\n", work.manifold, work.epsilon,
                static_cast<unsigned long long>(one.vertices), 1, one.seconds);
    good = good && one.certified;
    for (int threads = 2; threads <= cores; threads *= 2) {
      const Outcome many = Best(*manifold, work.epsilon, threads);
      const double share = (many.seconds / one.seconds - 1.0 / threads) / (1 - 1.0 / threads);
      const double serial = std::clamp(share, 0.0, 1.0);
      const bool same = many.fingerprint == one.fingerprint;
      std::printf("%-14s %7g %9llu %7d %9.3f %5.2fx %6.0f %% %8.1fx  %s\n", work.manifold,
                  work.epsilon, static_cast<unsigned long long>(many.vertices), threads,
                  many.seconds, one.seconds / many.seconds, 100 * serial,
                  1 / (serial + (1 - serial) / 64), same ? "the same" : "DIFFERENT");
      std::fflush(stdout);
      good = good && same && many.certified;
    }
  }
  return good ? 0 : 1;
}
