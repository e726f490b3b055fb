// Meshes what an oracle command describes, again and again: for tests/bench/pipe.py.
//
//   pipe_timing COMMAND SERVER    reads an epsilon a line; says seconds, vertices and simplices
#include <chrono>
#include <cstdio>
#include <iostream>

#include "stellate/client.h"
#include "stellate/command_oracle.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  stellate::CommandOptions command;
  command.command = argv[1];
  const auto oracle = stellate::StartCommand(command);
  if (!oracle) return std::cerr << oracle.error().message << "\n", 1;
  stellate::MeshOptions options;
  options.connection.server = argv[2];
  for (double epsilon = 0; std::cin >> epsilon;) {
    options.epsilon = epsilon;
    const auto begin = std::chrono::steady_clock::now();
    const auto mesh = stellate::MeshManifold(**oracle, options);
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    if (!mesh) return std::cerr << mesh.error().message << "\n", 1;
    std::printf("%.6f %td %td\n", seconds.count(), mesh->points.cols(), mesh->simplices.cols());
    std::fflush(stdout);
  }
  return 0;
}
