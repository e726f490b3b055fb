#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "stellate/client.h"
#include "stellate/connection.h"
#include "stellate/error.h"
#include "stellate/monitor.h"
#include "stellate/oracle.h"

namespace stellate {

// Declares a mesh of the oracle's manifold on options.connection.server, which is required, and
// returns its name. Workers call ServeMesh with that name, here or elsewhere. No worker serves it
// yet; a server deletes a mesh that has no worker for too long. Errors as of MeshManifold.
Expected<std::string> DeclareMesh(Oracle& oracle, const MeshOptions& options);

// How to work for a mesh.
//
//   stellate::ServeOptions serving;
//   serving.connection = options.connection;
//   const auto name = stellate::DeclareMesh(oracle, options);
//   if (name) const auto ended = stellate::ServeMesh(oracle, *name, serving);
struct ServeOptions {
  Connection connection;  // its server must be given
  std::string worker;     // its name, for logs; at most 128 bytes
  // The most points in one call of the oracle; absent: as in MeshOptions.
  std::optional<std::uint32_t> max_chunk;
  std::stop_token stop;  // this worker leaves: its unanswered queries go to others
};

// Serves a declared mesh as one of its workers: answers the server's queries, on the calling
// thread, until the mesh is over. All workers of a mesh must answer for the same manifold.
//
// Returns the state that the mesh ended in; immediately for a mesh that was over before this worker
// came, so a late batch job is a success. kRefused: the oracle differs in kind from the one that
// the mesh was declared with, or there is no such mesh (any more). kStopped: `stop` was requested.
// An exception from the oracle reaches the caller unchanged, and the server as a failed oracle.
Expected<MeshState> ServeMesh(Oracle& oracle, const std::string& mesh_name,
                              const ServeOptions& options);

}  // namespace stellate
