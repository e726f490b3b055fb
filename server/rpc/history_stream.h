#pragma once

#include <grpcpp/support/server_callback.h>

#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "server/convert/error_map.h"
#include "server/rpc/call.h"
#include "server/rpc/streams.h"

namespace stellate::server {

// How long a client may leave what it was sent unread, unless MayLeaveUnread. It can resume.
inline constexpr auto kUnreadPatience = std::chrono::seconds(30);

// RESOURCE_EXHAUSTED: AddWatcher refused.
grpc::Status TooManyWatchers(ServerState& state, const Session& session);

// Of a mesh whose history is on the disk and has not come for `waited`. RESOURCE_EXHAUSTED: the
// server has no memory for it; INTERNAL: it cannot be read back; nothing: wait on.
std::optional<grpc::Status> NoHistory(ServerState& state, const Session& session,
                                      Clock::duration waited);

// One client's stream of a mesh's history: a cursor in it, and at most one message on its way. What
// the client does not read waits in the history, not here. gRPC, the mesh and the ticker call it,
// each from its own thread; the lock is held whenever a subclass is asked.
template <typename Request, typename Response>
class HistoryStream : public grpc::ServerBidiReactor<Request, Response>,
                      public SessionWatcher,
                      public Stream,
                      public std::enable_shared_from_this<HistoryStream<Request, Response>> {
 public:
  HistoryStream(ServerState& state, grpc::CallbackServerContext* context)
      : state_(state),
        context_(context),
        peer_(context->peer()),
        caller_(Identify(state, *context)) {}

  void Start() {
    self_ = this->shared_from_this();
    state_.streams.Add(self_);
    if (caller_) return this->StartRead(&request_);
    const std::lock_guard lock(mutex_);
    End(caller_.error());
    Pump();
  }

  void OnReadDone(bool ok) final {
    grpc::Status status = ok ? Attach() : NoRequest();
    const std::lock_guard lock(mutex_);
    if (!status.ok()) End(std::move(status));
    Pump();
  }

  void OnWriteDone(bool ok) final {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok) End(grpc::Status::CANCELLED);
    Pump();
  }

  void OnCancel() final {
    const std::lock_guard lock(mutex_);
    End(grpc::Status::CANCELLED);
    Pump();
  }

  void OnDone() final {
    std::shared_ptr<HistoryStream> self;  // outlives the lock
    const std::lock_guard lock(mutex_);
    done_ = true;
    self = std::move(self_);
  }

  void Wake() final {
    const std::lock_guard lock(mutex_);
    OnNews();
    Pump();
  }

  void Tick(TimePoint now) final {
    const std::lock_guard lock(mutex_);
    if (done_ || session_ == nullptr) return;
    if (!end_ && !state_.authenticator->StillHolds(*caller_)) End(TokenWithdrawn());
    const bool stuck = (writing_ || finished_) && now - last_write_ > kUnreadPatience;
    if (stuck && (finished_ || !MayLeaveUnread())) return context_->TryCancel();
    OnNews();
    Pump();
  }

  void StopServing() final {
    const std::lock_guard lock(mutex_);
    End(ShuttingDown());
    // A client that does not read must not hold up the stop.
    if (writing_ && !done_) context_->TryCancel();
    Pump();
  }

 protected:
  enum class Step { kWait, kSend, kSendLast };

  // Where to start in `session`, or why not. Before anything else, without the lock.
  virtual grpc::Status Choose(const Request& request, const Session& session) = 0;
  // What the log says is done with the mesh, after Choose; null: nothing worth a line.
  virtual const char* Action() const = 0;
  // Bytes of mesh in a message, after Choose.
  virtual std::uint64_t PartBytes() const { return server::PartBytes(state_.config); }
  // Fills response(), which is empty, or calls End.
  virtual Step Next() = 0;
  // The mesh has changed, or a second has passed.
  virtual void OnNews() {}
  virtual bool MayLeaveUnread() const { return false; }

  // The first end counts.
  void End(grpc::Status status) {
    if (!end_) end_ = std::move(status);
  }

  // The mesh's history, read from the disk if need be; null: not yet, or this calls End.
  const WatchLog* OpenHistory() {
    const TimePoint now = Clock::now();
    history_ = state_.store.OpenHistory(session_);
    if (history_ != nullptr) {
      wanted_since_.reset();
      return history_.get();
    }
    if (!wanted_since_) wanted_since_ = now;
    if (auto status = NoHistory(state_, *session_, now - *wanted_since_)) End(std::move(*status));
    return nullptr;
  }
  const WatchLog* history() const { return history_.get(); }
  void CloseHistory() { history_.reset(); }

  const ServerState& state() const { return state_; }
  const Session& session() const { return *session_; }
  Response* response() { return &response_; }

 private:
  grpc::Status Attach() {
    auto session = FindMesh(state_, *caller_, request_.name());
    if (!session) return session.error();
    grpc::Status status = Choose(request_, **session);
    if (!status.ok()) return status;
    auto memory = CountStream(state_, **session, PartBytes());
    if (!memory) return memory.error();
    {
      const std::lock_guard lock(mutex_);
      memory_ = std::move(*memory);
      last_write_ = Clock::now();
      session_ = *session;
    }
    if (!(*session)->history().AddWatcher(this->weak_from_this())) return TooManyWatchers(state_, **session);
    if (const char* const action = Action()) Audit(**session, *caller_, peer_, action);
    return grpc::Status::OK;
  }

  // Starts the next write, or the end, if none is on its way.
  void Pump() {
    if (writing_ || finished_) return;
    Step step = Step::kWait;
    if (!end_ && session_ != nullptr) {
      response_.Clear();
      step = Next();
    }
    if (!end_ && step == Step::kWait) return;
    finished_ = end_ || step == Step::kSendLast;
    last_write_ = Clock::now();
    if (finished_) history_.reset();
    if (end_) return this->Finish(*end_);
    state_.metrics.Sent(response_.ByteSizeLong());
    if (finished_) return this->StartWriteAndFinish(&response_, {}, grpc::Status::OK);
    writing_ = true;
    // Never with a buffer hint: gRPC 1.51 may keep such a message, and not call OnWriteDone, until
    // something else goes out on the connection.
    this->StartWrite(&response_);
  }

  ServerState& state_;
  grpc::CallbackServerContext* const context_;
  const std::string peer_;  // asked of the context while there surely is a call
  const tl::expected<Identity, grpc::Status> caller_;

  std::mutex mutex_;
  std::shared_ptr<HistoryStream> self_;
  std::shared_ptr<Session> session_;
  std::unique_ptr<MemoryBudget::Account> memory_;
  std::shared_ptr<const WatchLog> history_;  // while it is read
  std::optional<TimePoint> wanted_since_;    // the history
  bool writing_ = false;
  bool finished_ = false;
  bool done_ = false;
  std::optional<grpc::Status> end_;
  TimePoint last_write_ = Clock::now();
  Request request_;
  Response response_;
};

}  // namespace stellate::server
