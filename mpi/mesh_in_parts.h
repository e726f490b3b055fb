#pragma once

#include <mpi.h>

#include <memory>
#include <string>
#include <vector>

#include "stellate/client.h"
#include "stellate/oracle.h"

namespace stellate::mpi {

// Meshes the oracle's manifold in all ranks of `comm` together, without a server: each has an
// oracle of the same manifold, answers its share of each round, and computes its share of what is
// shared out (Mesher::CreatePart); each holds the mesh. The first writes it to `paths`. The mesh
// is the same, bit for bit, for any number of ranks.
//
// `made`: the oracle, or why this rank has none, which no rank goes on without.
//
// All ranks call it, with the same options. Those of servers and workers are not read, except
// `workers` and `max_chunk`; `on_progress` is called in the first rank. Returns the same in all.
// Errors: as of MeshManifoldTo, and kRefused for an epsilon that is to be chosen, and where ranks
// were given different manifolds or options. An exception from an oracle is kOracleFailed.
Expected<SavedMesh> MeshInParts(const Expected<std::unique_ptr<Oracle>>& made,
                                const std::vector<std::string>& paths, const MeshOptions& options,
                                MPI_Comm comm);

}  // namespace stellate::mpi
