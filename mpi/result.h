#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/mesher.h"
#include "server/history/mesh_history.h"
#include "server/session/mesh_request.h"
#include "stellate/download.h"
#include "stellate/v1/mesh.pb.h"

namespace stellate::mpi {

// A mesh that is over.
struct Result {
  v1::Mesh mesh;                                   // what is said of it, without geometry
  std::unique_ptr<server::MeshHistory> history{};  // its geometry, where it is to be written
};

// The geometry of a mesh that is over, in one revision, oriented. `walls`: of each vertex up to the
// last that is on any.
std::unique_ptr<server::MeshHistory> HistoryOf(const core::Mesher& mesher,
                                               core::Execution execution,
                                               std::vector<core::WallSet> walls);

// The mesh with its geometry, as DownloadMesh returns it.
Expected<Mesh> WholeOf(const Result& result);

// What is said of a mesh that is in no file.
SavedMesh Unsaved(const Result& result);
// Writes it to files, as DownloadMeshTo does. Returns an error for each that could not be written.
std::vector<Error> Save(const Result& result, const std::vector<std::string>& paths);

}  // namespace stellate::mpi
