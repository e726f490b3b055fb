#include "server/rpc/call.h"

#include <exception>
#include <new>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"

namespace stellate::server {
namespace {

// The trace that a call is a part of; empty where it says none, or none that can be.
TraceHeaders TraceOf(const grpc::ServerContextBase& context) {
  const auto& metadata = context.client_metadata();
  TraceHeaders headers;
  const auto parent = metadata.find(kTraceParent);
  // Of two, nobody knows which is meant.
  if (parent == metadata.end() || metadata.count(kTraceParent) > 1) return {};
  headers.parent.assign(parent->second.data(), parent->second.size());
  const auto state = metadata.find(kTraceState);
  if (state != metadata.end()) headers.state.assign(state->second.data(), state->second.size());
  const auto read = ReadTraceContext(headers);
  if (!read) return {};
  headers.parent.resize(kTraceParentBytes);
  headers.state = read->state;
  return headers;
}

}  // namespace

void Audit(const Session& session, const Identity& caller, const std::string& peer,
           const char* action) {
  LogContext context = session.log_context();
  context.owner = caller.owner;
  Log(LogLevel::kInfo, context, "audit",
      LogFields()
          .Add("action", action)
          .Add("by", caller.owner)
          .Add("administrator", caller.administrator)
          .Add("owner", session.request().owner)
          .Add("address", peer));
}

tl::expected<std::shared_ptr<Session>, grpc::Status> FindMesh(const ServerState& state,
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
  auto session = state.store.Find(name);
  if (session != nullptr && IsElsewhere(*session)) return tl::unexpected(MovedAway());
  if (session == nullptr || (session->request().owner != caller.owner && !caller.administrator)) {
    return tl::unexpected(Refusal(v1::ERROR_REASON_MESH_NOT_FOUND,
                                  core::Message("there is no mesh ", name,
                                                ": the name is wrong, or it was deleted, or it "
                                                "ended too long ago to be kept")));
  }
  return session;
}

void ShowMesh(const Call& call, const Session& session, v1::Mesh* mesh) {
  ToProto(session, mesh);
  if (call.caller.administrator) mesh->set_owner(session.request().owner);
}

tl::expected<Identity, grpc::Status> Identify(ServerState& state,
                                              const grpc::ServerContextBase& context) {
  auto identity = state.authenticator->Identify(context);
  if (!identity) {
    state.metrics.Refused();
  } else {
    identity->trace = TraceOf(context);
  }
  return identity;
}

grpc::Status Refuse(ServerState& state, const Refused& refused, const std::string& prefix) {
  if (refused.limit) state.metrics.LimitReached(refused.limit->setting);
  return ToGrpc(refused, prefix);
}

tl::expected<std::shared_ptr<Session>, grpc::Status> DeclareMesh(const Call& call,
                                                                 MeshRequest request,
                                                                 const NewMeshBytes& bytes) {
  ServerState& state = call.state;
  SessionOptions options;
  options.request = std::move(request);
  ApplyServerPolicy(state, &options);
  if (const auto full = options.ports.memory->Set(bytes.memory)) {
    return tl::unexpected(Refuse(state, *full));
  }
  if (state.journal != nullptr) {
    const auto no_room =
        state.journal->RefuseNewMesh(options.request.owner, kFirstRecordBytes + bytes.record);
    if (no_room) return tl::unexpected(Refuse(state, *no_room));
  }
  auto session = state.store.Create(std::move(options));
  if (!session) return tl::unexpected(Refuse(state, session.error()));
  Audit(**session, call.caller, call.peer, "create");
  return std::move(*session);
}

tl::expected<std::unique_ptr<MemoryBudget::Account>, grpc::Status> CountStream(
    ServerState& state, const Session& session, std::uint64_t part) {
  auto memory = MemoryBudget::Open(state.stream_memory, session.request().owner);
  const auto full = memory->Set(EstimateStreamBytes(session.request().spec, part));
  if (full) return tl::unexpected(Refuse(state, *full));
  return memory;
}

grpc::Status Guarded(const std::function<grpc::Status()>& handler) {
  try {
    return handler();
  } catch (const std::bad_alloc&) {
    return Refusal(v1::ERROR_REASON_LIMIT_EXCEEDED, "the server is out of memory");
  } catch (const std::exception& error) {
    Log(LogLevel::kError, {}, core::Message("a handler failed: ", error.what()));
    return Refusal(v1::ERROR_REASON_INTERNAL, "a fault of the server: see its log");
  }
}

grpc::Status NoRequest() {
  return Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                 "no request came that this rpc understands: send one message, as "
                 "stellate/v1/stellate.proto defines it");
}

grpc::Status MovedAway() {
  return Refusal(v1::ERROR_REASON_SHUTTING_DOWN,
                 "the mesh goes from one server to another: call again in a moment");
}

grpc::Status FromPeer(grpc::Status status) {
  const bool is_silence =
      status.error_code() == grpc::StatusCode::UNAVAILABLE && status.error_details().empty();
  if (!is_silence) return status;
  Log(LogLevel::kWarning, {}, "the server that has a mesh does not answer",
      LogFields().Add("why", status.error_message()));
  return Refusal(v1::ERROR_REASON_SHUTTING_DOWN,
                 "the server that has the mesh does not answer; where it has died, another takes "
                 "its place within seconds: call again in a moment");
}

std::optional<grpc::Status> RefuseBeyondLimit(ServerState& state, const Session& session) {
  if (!IsBeyondLimit(session)) return std::nullopt;
  const std::string message = session.View().failure.message;
  state.store.Delete(session.request().name);
  return Refuse(state,
                {{"owner-meshes", core::Message(state.config()->owner_meshes), "owner"}, message});
}

grpc::Status ShuttingDown() {
  return Refusal(v1::ERROR_REASON_SHUTTING_DOWN, "the server is stopping: connect again later");
}

}  // namespace stellate::server
