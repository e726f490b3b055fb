#pragma once

#include <mpi.h>

#include <string>
#include <vector>

#include "stellate/client.h"
#include "stellate/oracle.h"

namespace stellate {

// Meshes the oracle's manifold in all ranks of `comm` together, without a server. Each rank has an
// oracle of the same manifold, which answers its share of each round, and computes its share of
// what can be shared out. The mesh is the one that a server makes, bit for bit, for any number of
// ranks.
//
//   MPI_Init_thread(&argc, &argv, MPI_THREAD_SERIALIZED, &provided);
//   stellate::MeshOptions options;
//   options.epsilon = 0.1;
//   const auto mesh = stellate::MeshInParts(oracle, options, MPI_COMM_WORLD);
//   if (!mesh) std::cerr << mesh.error().message;
//   else if (mesh->report.certified()) ...
//
// All ranks call it, with the same options, and get the same: the whole mesh, or the same error,
// which says in which rank it arose. An exception from an oracle is kOracleFailed in all.
//
// Of the options, `connection` and the times of workers are not read, as there is no server.
// `workers` threads of a rank call its oracle in parallel, `max_chunk` points at most at a time.
// `on_progress` is called in each rank that has one; if it throws, the run stops in all ranks, and
// the exception reaches its caller. A `stop` that is requested in one rank stops all, which return
// the mesh so far, not certified.
//
// Errors: as of MeshManifold; kRefused for kAuto, which takes a server, where ranks were given
// different manifolds or options, and where MPI is not initialized with MPI_THREAD_SERIALIZED.
Expected<Mesh> MeshInParts(Oracle& oracle, const MeshOptions& options, MPI_Comm comm);

// The same into files, which the first rank writes, as MeshManifoldTo does. The others hold no
// geometry but what they mesh with, unless there are pieces to write: of name.pvtu (k <= 3) each
// rank writes name/name_RANK.vtu, in one folder that all of them see, and the first the index. A
// piece has the simplices whose lowest vertex is in the rank's box of space, and their points, with
// the mesh's number of each as global ids. All of these files are written or none.
Expected<SavedMesh> MeshInPartsTo(Oracle& oracle, const std::vector<std::string>& paths,
                                  const MeshOptions& options, MPI_Comm comm);

}  // namespace stellate
