#include <optional>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/rpc/handlers.h"

namespace stellate::server {
namespace {

// How long a client may leave a message unread: it can resume where it stopped.
constexpr auto kPatience = std::chrono::seconds(30);

// One reader's stream: a cursor in the mesh's history, and one message on its way. Counts as a
// watcher of the mesh.
class DownloadStream final
    : public grpc::ServerBidiReactor<v1::DownloadMeshRequest, v1::DownloadMeshResponse>,
      public SessionWatcher,
      public Stream,
      public std::enable_shared_from_this<DownloadStream> {
 public:
  DownloadStream(ServerState& service, grpc::CallbackServerContext* context)
      : service_(service), context_(context), caller_(Identify(service, *context)) {}

  void Start() {
    self_ = shared_from_this();
    service_.streams.Add(self_);
    if (caller_) return StartRead(&request_);
    const std::lock_guard lock(mutex_);
    end_ = caller_.error();
    Pump();
  }

  void OnReadDone(bool ok) override {
    grpc::Status status = ok ? Attach(request_) : NoRequest();
    const std::lock_guard lock(mutex_);
    if (!status.ok() && !end_) end_ = std::move(status);
    Pump();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok && !end_) end_ = grpc::Status::CANCELLED;
    Pump();
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    if (!end_) end_ = grpc::Status::CANCELLED;
    Pump();
  }

  void OnDone() override {
    std::shared_ptr<DownloadStream> self;  // outlives the lock
    const std::lock_guard lock(mutex_);
    done_ = true;
    self = std::move(self_);
  }

  void Wake() override {
    const std::lock_guard lock(mutex_);
    Pump();
  }

  void Tick(TimePoint now) override {
    const std::lock_guard lock(mutex_);
    if (done_ || session_ == nullptr) return;
    if (!end_ && !service_.authenticator->StillHolds(*caller_)) end_ = TokenWithdrawn();
    if ((writing_ || finished_) && now - last_write_ > kPatience) return context_->TryCancel();
    Pump();
  }

  void StopServing() override {
    const std::lock_guard lock(mutex_);
    if (!end_) end_ = ShuttingDown();
    // A client that does not read must not hold up the stop.
    if (writing_ && !done_) context_->TryCancel();
    Pump();
  }

 private:
  grpc::Status Attach(const v1::DownloadMeshRequest& request) {
    auto session = FindMesh(service_, *caller_, request.name());
    if (!session) return session.error();
    const std::uint64_t newest = (*session)->PublishedRevision();
    if (request.revision() > newest) return NoSuchRevision(request.revision(), newest);
    if (request.position() > 0 && request.revision() == 0) {
      return Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                     core::Message("position is ", request.position(),
                                   " but revision is not set: a position belongs to the revision "
                                   "that it came with"),
                     "position");
    }
    auto memory = CountStream(service_, **session, PartBytes(service_.config));
    if (!memory) return memory.error();
    {
      const std::lock_guard lock(mutex_);
      memory_ = std::move(*memory);
      revision_ = request.revision() > 0 ? request.revision() : newest;
      position_ = request.position();
      attached_ = last_write_ = Clock::now();
      session_ = *session;
    }
    if ((*session)->AddWatcher(weak_from_this())) return grpc::Status::OK;
    return TooManyWatchers(service_, **session);
  }

  static grpc::Status NoSuchRevision(std::uint64_t wanted, std::uint64_t newest) {
    return Refusal(v1::ERROR_REASON_REVISION_TOO_NEW,
                   core::Message("the mesh has no revision ", wanted, ", as the newest one is ",
                                 newest, ": leave revision 0 for that"),
                   "revision");
  }

  // Once the history has got as far: a recorded mesh may be in the middle of its replay, or on the
  // disk.
  void Begin() {
    const bool over = session_->HasEnded();  // before the revision: nothing follows then
    history_ = service_.store.OpenHistory(session_);
    if (history_ == nullptr) {
      end_ = NoHistory(service_, *session_, Clock::now() - attached_);
      return;
    }
    const std::uint64_t newest = history_->revision();
    if (newest < revision_) {
      if (over) end_ = NoSuchRevision(revision_, newest);
      return;
    }
    snapshot_ = history_->At(revision_);
    if (position_ <= snapshot_.positions) {
      cursor_ = history_->BeginAt(revision_, position_);
      return;
    }
    end_ = Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                   core::Message("position is ", position_, " but revision ", revision_,
                                 " of the mesh ends at ", snapshot_.positions,
                                 ": use the next_position of a message about this revision"),
                   "position");
  }

  // Starts the next write, or the end, if none is on its way.
  void Pump() {
    if (writing_ || finished_) return;
    if (!end_ && session_ != nullptr && !cursor_) Begin();
    if (end_) {
      finished_ = true;
      history_.reset();
      last_write_ = Clock::now();
      return Finish(*end_);
    }
    if (!cursor_) return;
    response_.Clear();
    TakePart();
    last_write_ = Clock::now();
    service_.metrics.Sent(response_.ByteSizeLong());
    if (response_.complete()) {
      finished_ = true;
      history_.reset();
      return StartWriteAndFinish(&response_, grpc::WriteOptions(), grpc::Status::OK);
    }
    writing_ = true;
    StartWrite(&response_);
  }

  void TakePart() {
    const core::Specification& spec = session_->options().spec;
    const DeltaPart part = history_->Next(&*cursor_, PartBytes(service_.config));
    ToProto(part, spec.dimension, spec.ambient_dimension, &response_);
    response_.set_vertices(snapshot_.vertices);
    response_.set_simplices(snapshot_.simplices);
    response_.set_next_position(cursor_->Position());
  }

  ServerState& service_;
  grpc::CallbackServerContext* const context_;
  const tl::expected<Identity, grpc::Status> caller_;

  std::mutex mutex_;
  std::shared_ptr<DownloadStream> self_;
  std::shared_ptr<Session> session_;
  std::unique_ptr<MemoryBudget::Account> memory_;
  std::uint64_t revision_ = 0;
  std::uint64_t position_ = 0;
  std::shared_ptr<const WatchLog> history_;  // while it is read
  WatchLog::Snapshot snapshot_;
  std::optional<WatchLog::Cursor> cursor_;
  bool writing_ = false;
  bool finished_ = false;
  bool done_ = false;
  std::optional<grpc::Status> end_;
  TimePoint attached_, last_write_;
  v1::DownloadMeshRequest request_;
  v1::DownloadMeshResponse response_;
};

}  // namespace

grpc::ServerBidiReactor<v1::DownloadMeshRequest, v1::DownloadMeshResponse>* DownloadMesh(
    ServerState& service, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<DownloadStream>(service, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
