// Meshes a built-in torus in the ranks of an MPI job, without a server.
//
//   mpirun -n 4 mesh_in_parts torus.vtu
#include <mpi.h>

#include <cstdlib>
#include <iostream>

#include "stellate/catalogue.h"
#include "stellate/mpi.h"

namespace {

int Mesh(const char* path) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  const auto torus = stellate::MakeManifold("torus").value();  // each rank's own oracle
  stellate::MeshOptions options;
  options.epsilon = 0.15;

  const auto mesh = stellate::MeshInParts(*torus, options, MPI_COMM_WORLD);
  if (!mesh) {
    if (rank == 0) std::cerr << mesh.error().message << "\n";
    return EXIT_FAILURE;
  }
  if (rank != 0) return EXIT_SUCCESS;  // every rank has the mesh: one of them says so
  std::cout << mesh->report.text;
  if (const auto saved = mesh->Save(path); !saved) {
    std::cerr << saved.error().message << "\n";
    return EXIT_FAILURE;
  }
  return mesh->report.certified() ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace

int main(int argc, char** argv) {
  int provided = 0;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
  const int status = argc == 2 ? Mesh(argv[1]) : EXIT_FAILURE;
  MPI_Finalize();
  return status;
}
