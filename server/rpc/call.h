#pragma once

#include <grpcpp/server_context.h>

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "server/auth/auth.h"
#include "server/base/refusal.h"
#include "server/rpc/server_state.h"
#include "stellate/v1/mesh.pb.h"

namespace stellate::server {

// A call and who makes it.
struct Call {
  ServerState& state;
  Identity caller;
  std::string peer;  // the address that it comes from
};

// Who calls, or UNAUTHENTICATED, counted.
tl::expected<Identity, grpc::Status> Identify(ServerState& state,
                                              const grpc::ServerContextBase& context);

// As ToGrpc; limits that were reached are counted.
grpc::Status Refuse(ServerState& state, const Refused& refused, const std::string& prefix = "");

// A line of the log: who does what with a mesh, and whose that is. Rationed by who does it.
void Audit(const Session& session, const Identity& caller, const std::string& peer,
           const char* action);

// The caller's mesh of that name, or an administrator's choice of any, or INVALID_ARGUMENT or
// NOT_FOUND. Another owner's mesh looks like one that does not exist. `field`: where the name
// stands.
tl::expected<std::shared_ptr<Session>, grpc::Status> FindMesh(const ServerState& state,
                                                              const Identity& caller,
                                                              const std::string& name,
                                                              const std::string& field = "name");

// What a mesh says of itself to the caller.
void ShowMesh(const Call& call, const Session& session, v1::Mesh* mesh);

// Counts an open call on the caller's mesh that sends messages of `part` bytes, as long as what it
// returns lives; or RESOURCE_EXHAUSTED.
tl::expected<std::unique_ptr<MemoryBudget::Account>, grpc::Status> CountStream(
    ServerState& state, const Session& session, std::uint64_t part);

// INVALID_ARGUMENT: the call has ended without a request, or with bytes that are none.
grpc::Status NoRequest();

// UNAVAILABLE: the server stops.
grpc::Status ShuttingDown();

}  // namespace stellate::server
