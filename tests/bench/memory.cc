// What a mesh takes of memory, beside what the server reckons with when it decides whether there is
// room for it (EstimateMeshBytes):
//
//   memory [MANIFOLD COARSE FINE]...
//
// A manifold is meshed at two sizes, each in a process of its own, with the history that a server
// keeps of it. What the finer one takes beyond the coarser one is compared: a process alone takes
// megabytes, too. Ends with 1 where the estimate is not within 0.8 to 1.5 of that.

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "server/history/mesh_history.h"
#include "server/memory/memory_budget.h"
#include "tests/support/make_manifold.h"
#include "tests/support/run_mesher.h"

namespace {

constexpr double kLeast = 0.8, kMost = 1.5;

struct Work {
  std::string manifold;
  double coarse = 0, fine = 0;
};

const Work kTable[] = {
    {"circle:2", 0.001, 0.00003},  {"circle:20", 0.001, 0.0001}, {"sphere:2", 0.03, 0.006},
    {"torus:1:0.4", 0.03, 0.0065}, {"sphere:2:20", 0.05, 0.015}, {"sphere:2:100", 0.12, 0.04},
    {"sphere:3", 0.3, 0.1},        {"flat-torus:3", 0.4, 0.17},  {"so3", 0.45, 0.21},
};

struct Taken {
  double vertices = 0;
  double estimated = 0, peak = 0;  // bytes
};

// The most that this process ever held, bytes.
double Peak() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    if (word != "VmHWM:") continue;
    double kilobytes = 0;
    status >> kilobytes;
    return 1024 * kilobytes;
  }
  std::fprintf(stderr, "memory: the system does not say what a process holds\n");
  std::exit(2);
}

Taken Mesh(const std::string& name, double epsilon) {
  const auto manifold = stellate::testing::Make(name);
  stellate::core::Specification spec = stellate::testing::SpecificationFor(*manifold, epsilon);
  spec.seeds.resize(0, 0);
  auto mesher = stellate::core::Mesher::Create(spec, {.threads = 1});
  if (!mesher) {
    std::fprintf(stderr, "%s\n", mesher.error().message.c_str());
    std::exit(2);
  }
  stellate::server::MeshHistory history(spec.dimension, spec.ambient_dimension);
  Taken taken;
  while (const auto batch = (*mesher)->NextBatch()) {
    taken.vertices = static_cast<double>((*mesher)->progress().vertices);
    taken.estimated = std::max(
        taken.estimated,
        static_cast<double>(stellate::server::EstimateMeshBytes(
            spec, (*mesher)->progress().vertices, static_cast<std::uint64_t>(batch->size()))));
    auto delta = (*mesher)->Absorb(stellate::testing::AnswersOf(*manifold, *batch));
    if (delta)
      (void)history.Append(*delta);
    else
      (*mesher)->Fail(delta.error());
  }
  taken.peak = Peak();
  return taken;
}

// In a process of its own.
Taken MeshApart(const std::string& name, double epsilon) {
  int ends[2];
  Taken taken;
  if (pipe(ends) != 0) std::exit(2);
  const pid_t child = fork();
  if (child == 0) {
    taken = Mesh(name, epsilon);
    _exit(write(ends[1], &taken, sizeof taken) == sizeof taken ? 0 : 2);
  }
  close(ends[1]);
  const bool whole = read(ends[0], &taken, sizeof taken) == sizeof taken;
  close(ends[0]);
  waitpid(child, nullptr, 0);
  if (!whole) std::exit(2);
  return taken;
}

bool Measure(const Work& work) {
  const Taken coarse = MeshApart(work.manifold, work.coarse);
  const Taken fine = MeshApart(work.manifold, work.fine);
  const double vertices = fine.vertices - coarse.vertices, measured = fine.peak - coarse.peak;
  const double share = (fine.estimated - coarse.estimated) / measured;
  const bool holds = share >= kLeast && share <= kMost;
  std::printf("%-14s %8g %9.0f %12.0f %12.0f %9.2f  %s\n", work.manifold.c_str(), work.fine,
              fine.vertices, measured / vertices, (fine.estimated - coarse.estimated) / vertices,
              share, holds ? "" : "NOT within 0.8 to 1.5");
  std::fflush(stdout);
  return holds;
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<Work> works(std::begin(kTable), std::end(kTable));
  if (argc > 1) works.clear();
  for (int i = 1; i + 2 < argc; i += 3)
    works.push_back({argv[i], std::atof(argv[i + 1]), std::atof(argv[i + 2])});
  std::printf("%-14s %8s %9s %12s %12s %9s\n", "manifold", "epsilon", "vertices", "B a vertex",
              "estimated", "share");
  bool all = true;
  for (const Work& work : works) all = Measure(work) && all;
  return all ? 0 : 1;
}
