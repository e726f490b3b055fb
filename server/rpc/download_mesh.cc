#include <optional>
#include <string>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/scale.h"
#include "server/rpc/history_stream.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {
namespace {

grpc::Status NoSuchRevision(std::uint64_t wanted, std::uint64_t newest) {
  return Refusal(v1::ERROR_REASON_REVISION_TOO_NEW,
                 core::Message("the mesh has no revision ", wanted, ", as the newest one is ",
                               newest, ": leave revision 0 for that"),
                 "revision");
}

grpc::Status BadPosition(std::uint64_t position, const std::string& why) {
  return Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                 core::Message("position is ", std::to_string(position), " but ", why), "position");
}

// One reader of one revision. Counts as a watcher of the mesh.
class DownloadStream final
    : public HistoryStream<v1::DownloadMeshRequest, v1::DownloadMeshResponse> {
 public:
  using HistoryStream::HistoryStream;

 private:
  grpc::Status Choose(const v1::DownloadMeshRequest& request, const Session& session) override {
    const std::uint64_t newest = session.history().PublishedRevision();
    if (request.revision() > newest) return NoSuchRevision(request.revision(), newest);
    if (request.position() > 0 && request.revision() == 0) {
      return BadPosition(request.position(),
                         "revision is not set: a position belongs to the revision that it came "
                         "with");
    }
    revision_ = request.revision() > 0 ? request.revision() : newest;
    position_ = request.position();
    return grpc::Status::OK;
  }

  const char* Action() const override { return "download"; }

  Step Next() override {
    if (!cursor_) Begin();
    if (!cursor_) return Step::kWait;
    const core::Specification& spec = session().request().spec;
    DeltaPart part = history()->Next(&*cursor_, PartBytes());
    ToOwnCoordinates(session().request().scale, &part.points);
    ToProto(part, spec.simplex_dimension(), spec.ambient_dimension, response());
    response()->set_vertices(snapshot_.vertices);
    response()->set_simplices(snapshot_.simplices);
    response()->set_next_position(cursor_->Position());
    return part.complete ? Step::kSendLast : Step::kSend;
  }

  // Once the history has got as far: a recorded mesh may be in the middle of its replay, or on the
  // disk.
  void Begin() {
    const bool over = session().HasEnded();  // before the revision: nothing follows then
    const MeshHistory* const history = OpenHistory();
    if (history == nullptr) return;
    const std::uint64_t newest = history->revision();
    if (newest < revision_) {
      if (over) End(NoSuchRevision(revision_, newest));
      return;
    }
    snapshot_ = history->At(revision_);
    if (position_ <= snapshot_.positions) {
      cursor_ = history->BeginAt(revision_, position_);
      return;
    }
    // The server before this one had oriented it.
    if (!over && position_ <= snapshot_.most_positions) return;
    End(BadPosition(
        position_,
        core::Message("revision ", revision_, " of the mesh ends at ", snapshot_.positions,
                      ": use the next_position of a message about this revision")));
  }

  std::uint64_t revision_ = 0;
  std::uint64_t position_ = 0;
  MeshHistory::Snapshot snapshot_;
  std::optional<MeshHistory::Cursor> cursor_;
};

}  // namespace

grpc::ServerBidiReactor<Incoming<v1::DownloadMeshRequest>, v1::DownloadMeshResponse>* DownloadMesh(
    ServerState& state, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<DownloadStream>(state, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
