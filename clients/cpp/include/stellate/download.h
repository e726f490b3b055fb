#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>

#include "stellate/client.h"
#include "stellate/error.h"
#include "stellate/mesh.h"

namespace stellate {

// What to do about a mesh that is not over yet.
enum class Unfinished {
  kRefuse,  // an error that says how it stands
  kWait,    // for its end, however long that takes
  kTake,    // as it is now: a complex that need not be closed, and has no report
};

struct DownloadOptions {
  std::string server;  // "host:port" or "unix:/path"; must be given
  Credentials credentials;
  Unfinished unfinished = Unfinished::kRefuse;
  // Any that the mesh has had, whatever became of the mesh; 0: the newest. Only the last revision
  // of a mesh that is over has a report.
  std::uint64_t revision = 0;
  // A server that goes away is waited for so long, and the download resumed where it broke off;
  // 0: not at all. A server that cannot be reached at the start is an error immediately.
  double reconnect_seconds = 180;
  std::function<void(const Outage&)> on_outage;
  double keepalive_seconds = 4;  // as in MeshOptions
  // Called once it is known what kind of mesh it is, before anything is waited for or fetched. An
  // error ends the download with it.
  std::function<Expected<void>(int dimension, int ambient_dimension)> on_found;
  // Called on the calling thread: while the mesh is waited for, and at each part that comes, with
  // the vertices and simplices that are here and those of the whole mesh.
  std::function<void(const Progress&)> on_progress;
  std::function<void(std::uint64_t received, std::uint64_t all)> on_part;
  std::stop_token stop;  // ends it with an error; nothing happens to the mesh
};

// Fetches a mesh that is on a server, by its name ("meshes/<id>"). It stays there.
//
// Returns a mesh whenever it ended by itself or was cancelled, certified or not: read Mesh::report.
// An error when there is none of that name, when it failed (its reason is the error's; kTake
// fetches what there is of it), or when the server is lost for good.
Expected<Mesh> DownloadMesh(const std::string& name, const DownloadOptions& options);

}  // namespace stellate
