#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/rpc/handlers.h"

namespace stellate::server {
namespace {

constexpr auto kHistoryWait = std::chrono::seconds(30);  // for memory

}  // namespace

tl::expected<std::shared_ptr<Session>, grpc::Status> FindMesh(const ServerState& service,
                                                              const Identity& caller,
                                                              const std::string& name,
                                                              const std::string& field) {
  if (!IsMeshName(name)) {
    return tl::unexpected(
        Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                core::Message(field, " is \"", Cut(name, 100),
                              "\" but must be \"meshes/\" and 32 hexadecimal digits: use the name "
                              "that CreateMesh returned"),
                field));
  }
  auto session = service.store.Find(name);
  if (session == nullptr || session->options().owner != caller.owner) {
    return tl::unexpected(Refusal(v1::ERROR_REASON_MESH_NOT_FOUND,
                                  core::Message("there is no mesh ", name,
                                                ": the name is wrong, or it was deleted, or it "
                                                "ended too long ago to be kept")));
  }
  return session;
}

tl::expected<Identity, grpc::Status> Identify(ServerState& service,
                                              const grpc::ServerContextBase& context) {
  auto identity = service.authenticator->Identify(context);
  if (!identity) service.metrics.Refused();
  return identity;
}

grpc::Status Refuse(ServerState& service, const Refused& refused, const std::string& prefix) {
  if (refused.limit) service.metrics.LimitReached(refused.limit->setting);
  return ToGrpc(refused, prefix);
}

tl::expected<std::unique_ptr<MemoryBudget::Account>, grpc::Status> CountStream(
    ServerState& service, const Session& session, std::uint64_t part) {
  auto memory = MemoryBudget::Open(service.stream_memory, session.options().owner);
  const auto full = memory->Set(EstimateStreamBytes(session.options().spec, part));
  if (full) return tl::unexpected(Refuse(service, *full));
  return memory;
}

grpc::Status TooManyWatchers(ServerState& service, const Session& session) {
  const std::size_t most = session.options().max_watchers;
  return Refuse(service, {{"max-watchers", core::Message(most), "mesh"},
                          core::Message("the mesh has ", most,
                                        " watchers, the most that this server allows: end one "
                                        "first, or raise --max-watchers")});
}

std::optional<grpc::Status> NoHistory(ServerState& service, const Session& session,
                                      Clock::duration waited) {
  if (session.HistoryIsLost()) {
    return Refusal(v1::ERROR_REASON_INTERNAL,
                   "the server cannot read the mesh back from its record: see its log");
  }
  if (waited < kHistoryWait) return std::nullopt;
  return Refuse(service,
                {{"max-memory-bytes", core::Message(service.config.max_memory_bytes), "server"},
                 "the mesh is on the server's disk, and it has no memory to read it back: "
                 "ask again when other meshes have ended, or raise --max-memory-bytes"});
}

grpc::Status NoRequest() {
  return Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                 "no request came that this rpc understands: send one message, as "
                 "stellate/v1/stellate.proto defines it");
}

grpc::Status ShuttingDown() {
  return Refusal(v1::ERROR_REASON_SHUTTING_DOWN, "the server is stopping: connect again later");
}

}  // namespace stellate::server
