#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/spec.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {
namespace {

// A mesh is begun only if there is room for this many vertices.
constexpr std::uint64_t kFirstVertices = 100;

// What a mesh records before it gets anywhere: its specification, and some answers.
std::uint64_t FirstRecordBytes(const core::Specification& spec) {
  constexpr std::uint64_t kFirst = std::uint64_t{1} << 16;
  return kFirst + static_cast<std::uint64_t>(spec.seeds.size()) * sizeof(double);
}

}  // namespace

grpc::Status CreateMesh(const Call& call, const v1::CreateMeshRequest& request, v1::Mesh* mesh) {
  ServerState& state = call.state;
  if (state.draining) return ShuttingDown();
  auto parsed = FromProto(request.spec(), state.config);
  if (!parsed) return Refuse(state, parsed.error(), "spec.");

  SessionOptions options;
  options.request = std::move(*parsed);
  options.request.owner = call.caller.owner;
  ApplyServerPolicy(state, &options);
  const auto full =
      options.ports.memory->Set(EstimateMeshBytes(options.request.spec, kFirstVertices, 0));
  if (full) return Refuse(state, *full);
  if (state.journal != nullptr) {
    const auto no_room =
        state.journal->RefuseNewMesh(options.request.owner, FirstRecordBytes(options.request.spec));
    if (no_room) return Refuse(state, *no_room);
  }
  const auto session = state.store.Create(std::move(options));
  if (!session) return Refuse(state, session.error());
  Audit(**session, call.caller, call.peer, "create");
  ToProto(**session, mesh);
  return grpc::Status::OK;
}

}  // namespace stellate::server
