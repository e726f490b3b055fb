#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "stellate/connection.h"
#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate {

// What to do if the mesh is not over yet.
enum class Unfinished {
  kRefuse,  // return an error with its progress
  kWait,    // wait for its end, without a limit of time
  kTake,    // fetch it as it is: a complex that need not be closed, and has no report
};

// What to download, and how to follow it.
//
//   stellate::DownloadOptions downloading;
//   downloading.connection.server = "mesher.example.org:7717";
//   downloading.unfinished = stellate::Unfinished::kWait;
//   const auto downloaded = stellate::DownloadMesh("meshes/1b9d6bcd", downloading);
struct DownloadOptions {
  Connection connection;  // its server must be given; a download resumes after an outage
  Unfinished unfinished = Unfinished::kRefuse;
  // Any revision that the mesh has had, however it ended; by default the newest. Only the last
  // revision of a mesh that is over has a report.
  std::optional<std::uint64_t> revision;
  // Called on the calling thread: on_progress during the wait, and on_part at each part, with the
  // vertices and simplices received and those of the whole mesh.
  std::function<void(const Progress&)> on_progress;
  std::function<void(std::uint64_t received, std::uint64_t all)> on_part;
  std::stop_token stop;  // ends it with kStopped; nothing happens to the mesh
};

// Fetches a mesh from a server by its name ("meshes/<id>"). The server keeps it.
//
// Returns a mesh whenever it ended by itself or was cancelled, certified or not: read Mesh::report.
// Returns an error if there is no such mesh, if it failed (with its reason; kTake fetches what it
// has), or if the server is lost.
Expected<Mesh> DownloadMesh(const std::string& name, const DownloadOptions& options);

// A mesh that is in files, and not in memory.
struct SavedMesh {
  int dimension = 0, ambient_dimension = 0;
  std::uint64_t vertices = 0, simplices = 0;
  Report report;
  // Of files that could not be written, kFileFailed; the others are there. Not all failed.
  std::vector<Error> failures;
};

// As DownloadMesh and Mesh::Save to each path, byte for byte, in little memory however large the
// mesh is: parts go into the files as they come, which take their places when they are whole. Still
// held whole are a mesh that is not over or that no server could orient, and what a format needs
// whole: .stl, .3mf, .glb, .npz and .nas; .off and .ply of solids; .msh, .vtu and .obj of a
// boundary alone; pipes. Of a manifold with boundary these three are written from a file without a
// name beside them, as large as they are, and its simplices at walls are held. An error leaves no
// file behind.
Expected<SavedMesh> DownloadMeshTo(const std::string& name, const std::vector<std::string>& paths,
                                   const DownloadOptions& options);

}  // namespace stellate
