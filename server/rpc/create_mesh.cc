#include "server/convert/mesh.h"
#include "server/convert/spec.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {
namespace {

// A mesh is begun only if there is room for this many vertices.
constexpr std::uint64_t kFirstVertices = 100;

}  // namespace

grpc::Status CreateMesh(const Call& call, const v1::CreateMeshRequest& request, v1::Mesh* mesh) {
  if (call.state.draining) return ShuttingDown();
  auto parsed = FromProto(request.spec(), call.state.config);
  if (!parsed) return Refuse(call.state, parsed.error(), "spec.");
  parsed->owner = call.caller.owner;
  const core::Specification& spec = parsed->spec;
  const NewMeshBytes bytes{EstimateMeshBytes(spec, kFirstVertices, 0),
                           static_cast<std::uint64_t>(spec.seeds.size()) * sizeof(double)};
  const auto session = DeclareMesh(call, std::move(*parsed), bytes);
  if (!session) return session.error();
  ToProto(**session, mesh);
  return grpc::Status::OK;
}

}  // namespace stellate::server
