// Meshes a built-in torus on a server: the one named, or a stellated of its own.
//
//   mesh_on_server torus.vtu [HOST:PORT]
#include <cstdlib>
#include <iostream>

#include "stellate/stellate.h"

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "name the file to write\n";
    return EXIT_FAILURE;
  }
  const auto torus = stellate::MakeManifold("torus").value();
  stellate::MeshOptions options;
  options.epsilon = 0.15;
  if (argc > 2) options.connection.server = argv[2];

  const auto mesh = stellate::MeshManifold(*torus, options);
  if (!mesh) {
    std::cerr << mesh.error().message << "\n";
    return EXIT_FAILURE;
  }
  std::cout << mesh->report.text;
  if (const auto saved = mesh->Save(argv[1]); !saved) {
    std::cerr << saved.error().message << "\n";
    return EXIT_FAILURE;
  }
  return mesh->report.certified() ? EXIT_SUCCESS : EXIT_FAILURE;
}
