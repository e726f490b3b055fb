#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "tests/load/load.h"
#include "tests/load/server_process.h"
#include "tests/support/run_mesher.h"

namespace stellate::load {
namespace {

constexpr int kRepetitions = 9;  // the best counts: what else runs here only adds
constexpr char kManifold[] = "torus";

struct NumpyRun {
  double seconds = 0, oracle_seconds = 0;
  long vertices = 0;
};

NumpyRun RunNumpy(const std::string& server, double epsilon) {
  const char* const script = std::getenv("STELLATE_NUMPY_CLIENT");
  if (script == nullptr) Die("$STELLATE_NUMPY_CLIENT must name numpy_client");
  const std::string command =
      std::string(script) + " --server " + server + " --epsilon " + std::to_string(epsilon);
  FILE* const output = popen(command.c_str(), "r");
  NumpyRun run;
  if (output == nullptr ||
      std::fscanf(output, "%lf %lf %ld", &run.seconds, &run.oracle_seconds, &run.vertices) != 3) {
    Die("the numpy client failed");
  }
  pclose(output);
  return run;
}

}  // namespace

int Overhead(double epsilon) {
  const auto manifold = Make(kManifold);
  ServerProcess server;
  constexpr double kNever = std::numeric_limits<double>::infinity();
  double in_process = kNever, remote = kNever, numpy = kNever, numpy_less_oracle = kNever;
  long vertices = 0, numpy_vertices = 0;
  for (int i = 0; i < kRepetitions; ++i) {
    const Stopwatch here;
    const auto run = testing::RunMesher(*manifold, testing::SpecificationFor(*manifold, epsilon));
    in_process = std::min(in_process, here.seconds());
    vertices = run.points.cols();

    const Stopwatch there;
    const Mesh mesh = MeshOn(server.address(), kManifold, epsilon, 1);
    remote = std::min(remote, there.seconds());
    if (mesh.points != run.points) Die("the mesh over loopback is another one");

    const NumpyRun python = RunNumpy(server.address(), epsilon);
    numpy = std::min(numpy, python.seconds);
    numpy_less_oracle = std::min(numpy_less_oracle, python.seconds - python.oracle_seconds);
    numpy_vertices = python.vertices;
  }
  std::printf("%s at epsilon %g: %ld vertices (numpy: %ld), best of %d\n", kManifold, epsilon,
              vertices, numpy_vertices, kRepetitions);
  std::printf("  in process        %7.3f s\n", in_process);
  std::printf("  C++ client        %7.3f s   %.2f times as long (aim: 1.3)\n", remote,
              remote / in_process);
  std::printf("  numpy client      %7.3f s\n", numpy);
  std::printf("    but its oracle  %7.3f s   %.2f times as long (aim: 1.4)\n", numpy_less_oracle,
              numpy_less_oracle / in_process);
  return 0;
}

}  // namespace stellate::load
