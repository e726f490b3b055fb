#include <optional>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/rpc/handlers.h"

namespace stellate::server {
namespace {

// How long a client may leave the end of its stream, or a deleted mesh, unread.
constexpr auto kPatience = std::chrono::seconds(30);

// One watcher's stream: a cursor in the mesh's history, and at most one message on its way. What
// it does not read waits in the history, not here.
class WatchStream final
    : public grpc::ServerBidiReactor<v1::WatchMeshRequest, v1::WatchMeshResponse>,
      public SessionWatcher,
      public Stream,
      public std::enable_shared_from_this<WatchStream> {
 public:
  WatchStream(ServerState& service, grpc::CallbackServerContext* context)
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
    if (!status.ok() && !end_) End(std::move(status));
    Pump();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok && !end_) End(grpc::Status::CANCELLED);
    Pump();
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    if (!end_) End(grpc::Status::CANCELLED);
    Pump();
  }

  void OnDone() override {
    std::shared_ptr<WatchStream> self;  // outlives the lock
    const std::lock_guard lock(mutex_);
    done_ = true;
    self = std::move(self_);
  }

  void Wake() override {
    const std::lock_guard lock(mutex_);
    progress_due_ = true;
    Pump();
  }

  void Tick(TimePoint now) override {
    const std::lock_guard lock(mutex_);
    if (done_ || session_ == nullptr) return;
    if (!end_ && !service_.authenticator->StillHolds(*caller_)) End(TokenWithdrawn());
    const bool stuck = (writing_ || finished_) && now - last_write_ > kPatience;
    const bool of_use = !finished_ && service_.store.Find(session_->options().name) != nullptr;
    if (stuck && !of_use) return context_->TryCancel();
    progress_due_ = true;
    Pump();
  }

  void StopServing() override {
    const std::lock_guard lock(mutex_);
    if (!end_) End(ShuttingDown());
    // A client that does not read must not hold up the stop.
    if (writing_ && !done_) context_->TryCancel();
    Pump();
  }

 private:
  grpc::Status Attach(const v1::WatchMeshRequest& request) {
    auto session = FindMesh(service_, *caller_, request.name());
    if (!session) return session.error();
    const std::uint64_t newest = (*session)->PublishedRevision();
    if (request.from_revision() > newest) {
      return Refusal(v1::ERROR_REASON_REVISION_TOO_NEW,
                     core::Message("from_revision is ", request.from_revision(),
                                   " but the newest revision is ", newest,
                                   ": watch from the last one that you have"),
                     "from_revision");
    }
    const std::uint64_t part = request.progress_only() ? 0 : PartBytes(service_.config);
    auto memory = CountStream(service_, **session, part);
    if (!memory) return memory.error();
    {
      const std::lock_guard lock(mutex_);
      memory_ = std::move(*memory);
      at_ = request.from_revision();
      geometry_ = !request.progress_only();
      last_write_ = Clock::now();
      session_ = *session;
    }
    if ((*session)->AddWatcher(weak_from_this())) return grpc::Status::OK;
    return TooManyWatchers(service_, **session);
  }

  void End(grpc::Status status) { end_ = std::move(status); }

  // Starts the next write, or the end, if none is on its way.
  void Pump() {
    if (writing_ || finished_) return;
    if (end_) {
      finished_ = true;
      history_.reset();
      last_write_ = Clock::now();
      return Finish(*end_);
    }
    if (session_ == nullptr) return;
    const bool over = session_->HasEnded();  // before the revision: nothing follows then
    response_.Clear();
    const std::uint64_t newest = session_->revision();
    const bool behind = geometry_ && !cursor_ && newest > at_;
    if (behind) Begin();
    if (end_) return Pump();
    if (cursor_) {
      TakePart();
    } else if (geometry_ && over && at_ > newest) {
      at_ = 0;
      response_.mutable_reset_mesh()->set_reason(
          "the mesh ended at an earlier revision than the one you have: forget your copy");
    } else if (progress_due_) {
      progress_due_ = false;
      ToProto(session_->View(), response_.mutable_progress());
    } else if (over && !behind) {
      finished_ = true;
      last_write_ = Clock::now();
      ToProto(*session_, response_.mutable_final());
      service_.metrics.Sent(response_.ByteSizeLong());
      return StartWriteAndFinish(&response_, grpc::WriteOptions(), grpc::Status::OK);
    } else {
      return;
    }
    writing_ = true;
    last_write_ = Clock::now();
    service_.metrics.Sent(response_.ByteSizeLong());
    grpc::WriteOptions options;
    if (progress_due_) options.set_buffer_hint();  // it goes out with the progress that follows
    StartWrite(&response_, options);
  }

  // What the client lacks may be on the disk, and come later.
  void Begin() {
    const TimePoint now = Clock::now();
    const auto history = service_.store.OpenHistory(session_);
    if (history != nullptr) {
      history_ = history;
      cursor_ = history_->Begin(at_);
      wanted_since_.reset();
      return;
    }
    if (!wanted_since_) wanted_since_ = now;
    end_ = NoHistory(service_, *session_, now - *wanted_since_);
  }

  void TakePart() {
    const core::Specification& spec = session_->options().spec;
    const DeltaPart part = history_->Next(&*cursor_, PartBytes(service_.config));
    ToProto(part, spec.dimension, spec.ambient_dimension, response_.mutable_delta());
    if (!part.complete) return;
    at_ = cursor_->to;
    cursor_.reset();
    history_.reset();
    progress_due_ = true;
  }

  ServerState& service_;
  grpc::CallbackServerContext* const context_;
  const tl::expected<Identity, grpc::Status> caller_;

  std::mutex mutex_;
  std::shared_ptr<WatchStream> self_;
  std::shared_ptr<Session> session_;
  std::unique_ptr<MemoryBudget::Account> memory_;
  bool geometry_ = true;
  std::uint64_t at_ = 0;                     // the client has all up to this revision
  std::shared_ptr<const WatchLog> history_;  // with the cursor
  std::optional<WatchLog::Cursor> cursor_;
  std::optional<TimePoint> wanted_since_;  // the history
  bool progress_due_ = true;
  bool writing_ = false;
  bool finished_ = false;
  bool done_ = false;
  std::optional<grpc::Status> end_;
  TimePoint last_write_ = Clock::now();
  v1::WatchMeshRequest request_;
  v1::WatchMeshResponse response_;
};

}  // namespace

grpc::ServerBidiReactor<v1::WatchMeshRequest, v1::WatchMeshResponse>* WatchMesh(
    ServerState& service, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<WatchStream>(service, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
