#include <memory>
#include <utility>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/spec.h"
#include "server/records/journal_format.h"
#include "server/rpc/history_stream.h"
#include "server/rpc/rpcs.h"
#include "server/rpc/server_stream.h"

namespace stellate::server {
namespace {

// A mesh is begun only if there is room for this many vertices.
constexpr std::uint64_t kFirstVertices = 100;

grpc::Status InvalidId(const std::string& message) {
  return Refusal(v1::ERROR_REASON_INVALID_ARGUMENT, message, "mesh_id");
}

// Whether one client declared both, and the same of them, in whatever trace.
bool AreSame(const MeshRequest& a, MeshRequest b) {
  b.trace = a.trace;
  return EncodeStart(a, {}) == EncodeStart(b, {});
}

// One client's declaration of a mesh. A stream, because the reply waits for the record.
class CreateStream final : public ServerStream<v1::CreateMeshRequest, v1::Mesh> {
 public:
  using ServerStream::ServerStream;

  void OnRequest(bool ok) override {
    const bool came = ok && request() != nullptr;
    grpc::Status status = came ? Guarded([this] { return Declare(*request()); }) : NoRequest();
    if (!status.ok()) return EndWith(std::move(status));
    const std::weak_ptr<CreateStream> self =
        std::static_pointer_cast<CreateStream>(shared_from_this());
    session()->ports().recorded->Then([self] {
      if (const auto stream = self.lock()) stream->Reply();
    });
  }

 private:
  grpc::Status Declare(const v1::CreateMeshRequest& request) {
    if (state().draining) return ShuttingDown();
    auto parsed = FromProto(request.spec(), *state().config());
    if (!parsed) return Refuse(state(), parsed.error(), "spec.");
    parsed->owner = caller().owner;
    parsed->trace = caller().trace;
    if (request.mesh_id().empty()) return Begin(std::move(*parsed), nullptr);
    parsed->name = core::Message("meshes/", request.mesh_id());
    if (!IsMeshName(parsed->name)) {
      return InvalidId(core::Message("mesh_id is \"", Cut(request.mesh_id(), 100),
                                     "\" but must be 32 hexadecimal digits, 0-9 and a-f: draw them "
                                     "at random, or leave it empty"));
    }
    const MeshRequest asked = *parsed;
    return Begin(std::move(*parsed), &asked);
  }

  // `asked`: the same, where the mesh may be there already.
  grpc::Status Begin(MeshRequest request, const MeshRequest* asked) {
    std::shared_ptr<Session> session;
    if (asked != nullptr) session = state().store.Find(asked->name);
    if (session == nullptr) {
      const NewMeshBytes bytes{
          EstimateMeshBytes(request.spec, kFirstVertices, 0),
          static_cast<std::uint64_t>(request.spec.seeds.size()) * sizeof(double)};
      auto declared = DeclareMesh({state(), caller(), peer()}, std::move(request), bytes);
      if (!declared) return declared.error();
      session = std::move(*declared);
    }
    if (asked != nullptr && !AreSame(session->request(), *asked)) {
      return InvalidId(
          "mesh_id is that of a mesh that was declared otherwise: draw another for this one");
    }
    grpc::Status status = Attach(session, 0);
    // Nobody would ask for it again.
    if (!status.ok() && asked == nullptr) state().store.Delete(session->request().name);
    return status;
  }

  void Reply() {
    const auto lock = Lock();
    Pump();
  }

  Step Next() override {
    if (!session()->ports().recorded->HasHappened()) return Step::kWait;
    if (auto refusal = RefuseBeyondLimit(state(), *session())) {
      End(std::move(*refusal));
      return Step::kWait;
    }
    ToProto(*session(), response());
    return Step::kSendLast;
  }

  bool IsStuck(TimePoint now) const override {
    return phase() == Phase::kFinished && now - last_write() > kUnreadPatience;
  }

  void OnTick(TimePoint /*now*/) override {}
};

}  // namespace

grpc::ServerBidiReactor<Incoming<v1::CreateMeshRequest>, v1::Mesh>* CreateMesh(
    ServerState& state, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<CreateStream>(state, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
