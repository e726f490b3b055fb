#pragma once

#include <grpcpp/server_context.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <tl/expected.hpp>

#include "server/auth/auth.h"
#include "server/base/refusal.h"
#include "server/rpc/server_state.h"
#include "stellate/v1/mesh.pb.h"

namespace stellate::server {

// A call and its caller.
struct Call {
  ServerState& state;
  Identity caller;
  std::string peer;  // the address that it comes from
};

// Returns the caller, or UNAUTHENTICATED, which it counts.
tl::expected<Identity, grpc::Status> Identify(ServerState& state,
                                              const grpc::ServerContextBase& context);

// As ToGrpc; counts the limits that were reached.
grpc::Status Refuse(ServerState& state, const Refused& refused, const std::string& prefix = "");

// Logs a caller's action on a mesh, and the mesh's owner. The number of lines of each caller is
// limited.
void Audit(const Session& session, const Identity& caller, const std::string& peer,
           const char* action);

// Returns the caller's mesh of that name (an administrator may name any), or INVALID_ARGUMENT or
// NOT_FOUND. Another owner's mesh looks like one that does not exist. `field`: where the name
// stands.
tl::expected<std::shared_ptr<Session>, grpc::Status> FindMesh(const ServerState& state,
                                                              const Identity& caller,
                                                              const std::string& name,
                                                              const std::string& field = "name");

// Writes the state of a mesh as the caller may see it.
void ShowMesh(const Call& call, const Session& session, v1::Mesh* mesh);

// What a mesh will take from its declaration on.
struct NewMeshBytes {
  std::uint64_t memory = 0;
  std::uint64_t record = 0;  // besides what every mesh records
};

// Makes a mesh of a request that has been checked, and whose owner is set, and starts it; or
// RESOURCE_EXHAUSTED.
tl::expected<std::shared_ptr<Session>, grpc::Status> DeclareMesh(const Call& call,
                                                                 MeshRequest request,
                                                                 const NewMeshBytes& bytes);

// Counts the memory of an open call that sends messages of `part` bytes, while the returned account
// lives; or RESOURCE_EXHAUSTED.
tl::expected<std::unique_ptr<MemoryBudget::Account>, grpc::Status> CountStream(
    ServerState& state, const Session& session, std::uint64_t part);

// What `handler` returns: no exception leaves it.
grpc::Status Guarded(const std::function<grpc::Status()>& handler);

// INVALID_ARGUMENT: the call has ended without a valid request.
grpc::Status NoRequest();

// UNAVAILABLE: the server stops.
grpc::Status ShuttingDown();
// UNAVAILABLE: the mesh is on its way to another server.
grpc::Status MovedAway();
// What a call that was passed on ended with, as its caller is to hear it: where the other server
// said nothing, UNAVAILABLE with this server's words. Logs that.
grpc::Status FromPeer(grpc::Status status);

// Once the mesh of a declaration is recorded: RESOURCE_EXHAUSTED where its owner has too many on
// all servers together, and nothing is left of it.
std::optional<grpc::Status> RefuseBeyondLimit(ServerState& state, const Session& session);

}  // namespace stellate::server
