#include <optional>
#include <utility>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/points.h"
#include "server/memory/memory_budget.h"
#include "server/points/point_intake.h"
#include "server/rpc/rpcs.h"
#include "server/rpc/server_stream.h"

namespace stellate::server {
namespace {

constexpr auto kReplyPatience = std::chrono::seconds(30);  // for a client to read the reply

// One upload of a mesh's points. gRPC calls the On... functions, the intake Proceed and End, the
// ticker Tick, each from its own thread.
class UploadStream final : public ServerStream<v1::PointsChunk, v1::ReconstructReply>,
                           public PointStream {
 public:
  using ServerStream::ServerStream;

  void OnRequest(bool ok) override {
    {
      const auto lock = Lock();
      reading_since_.reset();
    }
    if (!ok) return HalfClose();
    if (request() == nullptr) {
      return OutOfOrder(
          "a message came that is no PointsChunk of stellate/v1/stellate.proto: see what the "
          "client writes, and that text in it is UTF-8");
    }
    state().metrics.Received(request()->ByteSizeLong());
    Handle(*request());
  }

  void Proceed() override {
    {
      const auto lock = Lock();
      reading_since_ = Clock::now();
    }
    ReadNext();
  }

  void End(const core::Status& blame) override {
    if (blame.ok() || IsBeyondLimit(*session())) return Reply();
    EndWith(ToGrpc(blame));
  }

 private:
  void Handle(const v1::PointsChunk& request) {
    const bool opened = session() != nullptr;
    switch (request.message_case()) {
      case v1::PointsChunk::kSpec:
        if (!opened) return Declare(request.spec());
        return OutOfOrder("a second specification came: a stream makes one mesh; open another");
      case v1::PointsChunk::kMesh:
        if (!opened) return GoOn(request.mesh());
        return OutOfOrder("a mesh was named after the first message: open another stream for it");
      case v1::PointsChunk::kPoints:
        if (opened) return TakePoints(request.points());
        return OutOfOrder("points came first: send the specification, or the mesh's name, before");
      case v1::PointsChunk::kEnd:
        if (opened) return TakeEnd(request.end());
        return OutOfOrder("the end came first: send the specification, or the mesh's name, before");
      case v1::PointsChunk::MESSAGE_NOT_SET:
        return OutOfOrder("an empty message came: send spec, mesh, points or end");
    }
  }

  void OutOfOrder(const std::string& message) {
    Refuse(Refusal(v1::ERROR_REASON_OUT_OF_ORDER, message));
  }
  void Refuse(const grpc::Status& status) {
    EndWith(status);
    Leave();
  }

  // The client will say no more, or has gone.
  void HalfClose() {
    if (session() == nullptr) return Refuse(NoRequest());
    Reply();
    Leave();
  }

  // Once the mesh is recorded.
  void Reply() {
    const std::weak_ptr<UploadStream> self =
        std::static_pointer_cast<UploadStream>(shared_from_this());
    session()->ports().recorded->Then([self] {
      if (const auto stream = self.lock()) stream->ReplyNow();
    });
  }
  void ReplyNow() {
    if (const auto refusal = RefuseBeyondLimit(state(), *session())) return Refuse(*refusal);
    const auto lock = Lock();
    reply_ = true;
    Pump();
  }

  void Declare(const v1::Reconstruction& spec) {
    if (state().draining) return Refuse(ShuttingDown());
    auto declared = FromProto(spec, *state().config());
    if (!declared) return Refuse(server::Refuse(state(), declared.error(), "spec."));
    declared->owner = caller().owner;
    declared->trace = caller().trace;
    const PointsRequest& points = *declared->points;
    const NewMeshBytes bytes{EstimateReconstructionBytes(points.spec, points.points),
                             points.points * BytesOfPoint(points)};
    auto session = DeclareMesh({state(), caller(), peer()}, std::move(*declared), bytes);
    if (!session) return Refuse(session.error());
    if (auto status = Attach(*session, PartBytes(*state().config())); !status.ok()) {
      state().store.Delete((*session)->request().name);
      return Refuse(status);
    }
    Join();
  }

  void GoOn(const std::string& name) {
    const auto mesh = FindMesh(state(), caller(), name, "mesh");
    if (!mesh) return Refuse(mesh.error());
    if ((*mesh)->request().owner != caller().owner) {
      return Refuse(Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                            "the mesh is another owner's: an administrator may see and end it, not "
                            "send its points",
                            "mesh"));
    }
    if ((*mesh)->intake() == nullptr) {
      return Refuse(Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                            "the mesh is made of the answers of an oracle, not of points", "mesh"));
    }
    if (auto status = Attach(*mesh, PartBytes(*state().config())); !status.ok())
      return Refuse(status);
    Audit(*session(), caller(), peer(), "upload");
    Join();
  }

  // Where the mesh is over there is nothing to join: a client that asks is told so.
  void Join() {
    {
      const auto lock = Lock();
      joined_ = true;  // it may be told to proceed, or of an end, before Join returns
    }
    const auto self = std::static_pointer_cast<UploadStream>(shared_from_this());
    if (session()->intake()->Join(self).ok()) return;
    {
      const auto lock = Lock();
      joined_ = false;
    }
    Proceed();
  }

  void TakePoints(const v1::Points& points) {
    if (!IsJoined()) return IsBeyondLimit(*session()) ? Reply() : Refuse(IsOver());
    auto part = FromProto(points, *session()->request().points);
    core::Status status =
        part ? session()->intake()->Offer(this, std::move(*part)) : std::move(part.error());
    if (!status.ok()) Refuse(ToGrpc(status));
  }

  void TakeEnd(const v1::PointsEnd& end) {
    if (!IsJoined()) return Reply();  // the mesh is over: it came before
    const core::Status status =
        session()->intake()->OfferEnd(this, {end.points_sha256(), end.tangents_sha256()});
    if (!status.ok()) Refuse(ToGrpc(status));
  }

  bool IsJoined() {
    const auto lock = Lock();
    return joined_;
  }

  grpc::Status IsOver() const {
    return Refusal(
        v1::ERROR_REASON_FAILED_PRECONDITION,
        core::Message("the mesh is over, as ", v1::MeshState_Name(ToProto(session()->View().state)),
                      ", and takes no more points"));
  }

  void Leave() override {
    const auto lock = Lock();
    LeaveLocked();
  }
  void LeaveLocked() {
    if (std::exchange(joined_, false)) session()->intake()->Leave(this);
  }

  Step Next() override {
    if (!reply_) return Step::kWait;
    ToProto(*session(), response()->mutable_mesh());
    // Vertices may be more: those that the run added.
    response()->set_rows(
        std::min(session()->request().points->points,
                 std::max(session()->intake()->rows(), response()->mesh().progress().vertices())));
    return Step::kSendLast;
  }

  bool IsStuck(TimePoint now) const override {
    if (phase() == Phase::kFinished) return now - last_write() > kReplyPatience;
    return has_ended() && now - ended() > kReplyPatience;
  }

  void OnTick(TimePoint now) override {
    if (has_ended() || phase() != Phase::kIdle) return;
    if (session() == nullptr) {
      const auto patience = std::chrono::duration<double>(state().config()->hello_seconds);
      if (now - opened_ <= patience) return;
      return EndLate(core::Message("no specification came within ", patience.count(),
                                   " seconds: send it first"));
    }
    const auto patience = session()->request().timeouts.answer_limit;
    if (!reading_since_ || now - *reading_since_ <= patience) return;
    EndLate(
        core::Message("no message came within ", std::chrono::duration<double>(patience).count(),
                      " seconds (limits.answer_seconds): open another stream, and go on from row ",
                      session()->intake()->rows()));
  }

  // (locked)
  void EndLate(const std::string& message) {
    ServerStream::End(Refusal(v1::ERROR_REASON_OUT_OF_ORDER, message));
    LeaveLocked();
    Pump();
  }

  const TimePoint opened_ = Clock::now();

  // With the lock:
  bool joined_ = false;                     // the intake
  bool reply_ = false;                      // is due
  std::optional<TimePoint> reading_since_;  // it is the client's turn
};

}  // namespace

grpc::ServerBidiReactor<Incoming<v1::PointsChunk>, v1::ReconstructReply>* Reconstruct(
    ServerState& state, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<UploadStream>(state, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
