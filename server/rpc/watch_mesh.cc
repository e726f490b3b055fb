#include <optional>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/scale.h"
#include "server/rpc/history_stream.h"
#include "server/rpc/rpcs.h"

namespace stellate::server {
namespace {

class WatchStream final : public HistoryStream<v1::WatchMeshRequest, v1::WatchMeshResponse> {
 public:
  using HistoryStream::HistoryStream;

 private:
  grpc::Status Choose(const v1::WatchMeshRequest& request, const Session& session) override {
    const std::uint64_t newest = session.history().SeenRevision();
    if (request.from_revision() > newest) {
      return Refusal(v1::ERROR_REASON_REVISION_TOO_NEW,
                     core::Message("from_revision is ", request.from_revision(),
                                   " but the newest revision is ", newest,
                                   ": watch from the last one that you have"),
                     "from_revision");
    }
    at_ = request.from_revision();
    geometry_ = !request.progress_only();
    return grpc::Status::OK;
  }

  const char* Action() const override { return geometry_ ? "watch" : nullptr; }
  std::uint64_t PartBytes() const override { return geometry_ ? HistoryStream::PartBytes() : 0; }
  void OnNews() override { progress_due_ = true; }
  // A watcher may take its time, as long as there is a mesh.
  Clock::duration Patience() const override {
    if (state().store.Find(session().request().name) == nullptr) return kUnreadPatience;
    return std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(state().config()->unread_seconds));
  }

  Step Next() override {
    const bool over = session().HasEnded();  // before the revision: nothing follows then
    const std::uint64_t newest = session().history().revision();
    const bool behind = geometry_ && !cursor_ && newest > at_;
    if (behind) {
      if (const MeshHistory* const history = OpenHistory()) cursor_ = history->Begin(at_);
    }
    if (cursor_) {
      TakePart();
    } else if (geometry_ && over && at_ > newest) {
      at_ = 0;
      response()->mutable_reset_mesh()->set_reason(
          "the mesh ended at an earlier revision than the one you have: forget your copy");
    } else if (progress_due_) {
      progress_due_ = false;
      ToProto(session().View(), response()->mutable_progress());
    } else if (over && !behind && OweOrientation()) {
      return TakeOrientation();
    } else if (over && !behind) {
      ToProto(session(), response()->mutable_final());
      return Step::kSendLast;
    } else {
      return Step::kWait;
    }
    return Step::kSend;
  }

  void TakePart() {
    const core::Specification& spec = session().request().spec;
    DeltaPart part = history()->Next(&*cursor_, PartBytes());
    ToOwnCoordinates(session().request().scale, &part.points);
    ToProto(part, spec.simplex_dimension(), spec.ambient_dimension, response()->mutable_delta());
    if (!part.complete) return;
    at_ = cursor_->to;
    cursor_.reset();
    CloseHistory();
    progress_due_ = true;
  }

  bool OweOrientation() const {
    return geometry_ && at_ > 0 && !was_oriented_ && !session().history().IsLost();
  }

  Step TakeOrientation() {
    if (!orientation_) {
      const MeshHistory* const history = OpenHistory();
      if (history == nullptr) return Step::kWait;
      orientation_ = history->orientation();
      CloseHistory();
    }
    was_oriented_ = !orientation_;
    if (was_oriented_) return Next();
    oriented_bytes_ =
        ToProto(*orientation_, oriented_bytes_, PartBytes(), response()->mutable_orientation());
    was_oriented_ = oriented_bytes_ == orientation_->turned.size();
    if (was_oriented_) orientation_.reset();
    return Step::kSend;
  }

  bool geometry_ = true;
  std::uint64_t at_ = 0;  // the client has all up to this revision
  std::optional<MeshHistory::Cursor> cursor_;
  bool progress_due_ = true;
  std::optional<core::Orientation> orientation_;  // while it is sent
  std::size_t oriented_bytes_ = 0;                // sent
  bool was_oriented_ = false;                     // there is nothing more to send
};

}  // namespace

grpc::ServerBidiReactor<Incoming<v1::WatchMeshRequest>, v1::WatchMeshResponse>* WatchMesh(
    ServerState& state, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<WatchStream>(state, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
