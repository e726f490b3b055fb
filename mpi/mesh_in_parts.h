#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stellate/mpi.h"

namespace stellate::mpi {

// As MeshInPartsTo, of an oracle that not every rank may have been able to make: where one has
// none, the error that it has in its place is returned in all.
Expected<SavedMesh> MeshInPartsTo(const Expected<std::unique_ptr<Oracle>>& made,
                                  const std::vector<std::string>& paths, const MeshOptions& options,
                                  MPI_Comm comm);

}  // namespace stellate::mpi
