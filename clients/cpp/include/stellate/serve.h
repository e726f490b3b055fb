#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "stellate/client.h"
#include "stellate/error.h"
#include "stellate/monitor.h"
#include "stellate/oracle.h"

namespace stellate {

// Declares a mesh of the oracle's manifold on options.server, which must be given, for ServeMesh to
// answer for, here or elsewhere. Gives its name. No worker serves it yet; a server deletes a mesh
// that has no worker for too long. Errors as of MeshManifold.
Expected<std::string> DeclareMesh(Oracle& oracle, const MeshOptions& options);

struct ServeOptions {
  std::string server;  // "host:port" or "unix:/path"; must be given
  Credentials credentials;
  std::string worker;  // its name, for logs; at most 128 bytes
  // The most points in one call of the oracle; absent: as in MeshOptions.
  std::optional<std::uint32_t> max_chunk;
  // As in MeshOptions, as is keepalive_seconds.
  double reconnect_seconds = 180;
  std::function<void(const Outage&)> on_outage;
  double keepalive_seconds = 4;
  std::stop_token stop;  // takes this worker away: what it has not answered goes to others
};

// One more worker for a mesh that somebody else declared: answers the server's questions, on the
// calling thread, until the mesh is over. All workers of a mesh have to answer for one manifold.
//
// Returns the state that the mesh ended in; immediately for a mesh that was over before this worker
// came, so a late batch job is a success. kRefused for an oracle of another kind than the mesh was
// declared with, and for a mesh that is not there, or was over and is no longer kept. Reason
// "CANCELLED" where `stop` was requested. An exception out of the oracle reaches the caller as it
// is, and the server as a failed oracle.
Expected<MeshState> ServeMesh(Oracle& oracle, const std::string& mesh_name,
                              const ServeOptions& options);

}  // namespace stellate
