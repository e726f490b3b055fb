#pragma once

#include <grpcpp/server_context.h>

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "server/auth/auth.h"
#include "server/base/refusal.h"
#include "server/rpc/server_state.h"

namespace stellate::server {

// A call and who makes it.
struct Call {
  ServerState& state;
  Identity caller;
};

// Who calls, or UNAUTHENTICATED, counted.
tl::expected<Identity, grpc::Status> Identify(ServerState& state,
                                              const grpc::ServerContextBase& context);

// As ToGrpc; limits that were reached are counted.
grpc::Status Refuse(ServerState& state, const Refused& refused, const std::string& prefix = "");

// The caller's mesh of that name, or INVALID_ARGUMENT or NOT_FOUND. Another owner's mesh is not
// told from one that does not exist. `field`: where the name stands.
tl::expected<std::shared_ptr<Session>, grpc::Status> FindMesh(const ServerState& state,
                                                              const Identity& caller,
                                                              const std::string& name,
                                                              const std::string& field = "name");

// Counts an open call on the caller's mesh that sends messages of `part` bytes, as long as what it
// returns lives; or RESOURCE_EXHAUSTED.
tl::expected<std::unique_ptr<MemoryBudget::Account>, grpc::Status> CountStream(
    ServerState& state, const Session& session, std::uint64_t part);

// INVALID_ARGUMENT: the call has ended without a request, or with bytes that are none.
grpc::Status NoRequest();

// UNAVAILABLE: the server stops.
grpc::Status ShuttingDown();

}  // namespace stellate::server
