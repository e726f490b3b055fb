#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/server_callback.h>

#include <atomic>
#include <memory>
#include <optional>
#include <tl/expected.hpp>

#include "server/auth/auth.h"
#include "server/base/refusal.h"
#include "server/config/config.h"
#include "server/journal/journal.h"
#include "server/metrics/metrics.h"
#include "server/rpc/streams.h"
#include "server/session/memory_budget.h"
#include "server/session/session_store.h"
#include "stellate/v1/stellate.pb.h"

namespace stellate::server {

// What the handlers share.
struct ServerState {
  ServerState(const Config& config_in, StoreLimits limits, Session::MesherFactory factory)
      : config(config_in),
        memory(std::make_shared<MemoryBudget>(
            MemoryBudget::Limits{config.max_memory_bytes, config.owner_memory_bytes})),
        stream_memory(std::make_shared<MemoryBudget>(
            MemoryBudget::Limits{config.max_memory_bytes, config.owner_memory_bytes},
            MemoryBudget::Of::kStreams)),
        store(limits, std::move(factory)) {
    memory->MakeRoomBy([this] { return store.PutAwayHistories(); });
  }

  const Config config;
  const std::shared_ptr<MemoryBudget> memory, stream_memory;
  StreamRegistry streams;
  std::unique_ptr<Journal> journal;  // null: meshes live in memory alone
  SessionStore store;
  std::unique_ptr<Authenticator> authenticator;  // set before the first call
  Metrics metrics;
  std::atomic<bool> draining{false};  // no new meshes
};

// A call and who makes it.
struct Call {
  ServerState& service;
  Identity caller;
};

// Who calls, or UNAUTHENTICATED, counted.
tl::expected<Identity, grpc::Status> Identify(ServerState& service,
                                              const grpc::ServerContextBase& context);

// What a server decides about a mesh, whoever asked for it, into `options`, whose owner is set.
void Furnish(ServerState& service, SessionOptions* options);

// As ToGrpc; limits that were reached are counted.
grpc::Status Refuse(ServerState& service, const Refused& refused, const std::string& prefix = "");

// One function for each rpc, each in its own file. None of them waits for anything.
grpc::Status CreateMesh(const Call& call, const v1::CreateMeshRequest& request, v1::Mesh* mesh);
grpc::Status GetMesh(const Call& call, const v1::GetMeshRequest& request, v1::Mesh* mesh);
grpc::Status ListMeshes(const Call& call, const v1::ListMeshesRequest& request,
                        v1::ListMeshesResponse* response);
grpc::Status CancelMesh(const Call& call, const v1::CancelMeshRequest& request, v1::Mesh* mesh);
grpc::Status DeleteMesh(const Call& call, const v1::DeleteMeshRequest& request,
                        google::protobuf::Empty* empty);
grpc::Status GetServerInfo(const Call& call, const v1::GetServerInfoRequest& request,
                           v1::ServerInfo* info);
grpc::ServerBidiReactor<v1::ServeOracleRequest, v1::ServeOracleResponse>* ServeOracle(
    ServerState& service, grpc::CallbackServerContext* context);
grpc::ServerBidiReactor<v1::WatchMeshRequest, v1::WatchMeshResponse>* WatchMesh(
    ServerState& service, grpc::CallbackServerContext* context);
grpc::ServerBidiReactor<v1::DownloadMeshRequest, v1::DownloadMeshResponse>* DownloadMesh(
    ServerState& service, grpc::CallbackServerContext* context);

// The caller's mesh of that name, or INVALID_ARGUMENT or NOT_FOUND. Another owner's mesh is not
// told from one that does not exist. `field`: where the name stands.
tl::expected<std::shared_ptr<Session>, grpc::Status> FindMesh(const ServerState& service,
                                                              const Identity& caller,
                                                              const std::string& name,
                                                              const std::string& field = "name");

// Counts an open call on the caller's mesh that sends messages of `part` bytes, as long as what it
// returns lives; or RESOURCE_EXHAUSTED.
tl::expected<std::unique_ptr<MemoryBudget::Account>, grpc::Status> CountStream(
    ServerState& service, const Session& session, std::uint64_t part);

// RESOURCE_EXHAUSTED: AddWatcher refused.
grpc::Status TooManyWatchers(ServerState& service, const Session& session);

// Of a mesh whose history is on the disk and has not come for so long. RESOURCE_EXHAUSTED: the
// server has no memory for it; INTERNAL: it cannot be read back; nothing: wait on.
std::optional<grpc::Status> NoHistory(ServerState& service, const Session& session,
                                      Clock::duration waited);

// INVALID_ARGUMENT: the call has ended without a request, or with bytes that are none.
grpc::Status NoRequest();

// UNAVAILABLE: the server stops.
grpc::Status ShuttingDown();

}  // namespace stellate::server
