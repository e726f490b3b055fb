#pragma once

#include <grpcpp/support/server_callback.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "server/convert/error_map.h"
#include "server/rpc/call.h"
#include "server/rpc/incoming.h"
#include "server/rpc/relay.h"
#include "server/rpc/routing.h"
#include "server/rpc/streams.h"

namespace stellate::server {

// The skeleton of a streaming call: identifies the caller, keeps at most one message on its way,
// and ends the call once, for the first of all reasons that the client, the mesh, the ticker and
// the server may have. A subclass takes requests, attaches the stream to a mesh, and fills the
// messages. Where another server has the mesh that the first request names, the messages go there
// and come from there instead, and the subclass hears nothing of the call.
//
//   class Counter final : public ServerStream<Request, Response> {
//     void OnRequest(bool ok) override { ... request() Attach(mesh, bytes); ReadNext(); }
//     Step Next() override { response()->set_count(++count_); return Step::kSend; }
//   };
//   std::make_shared<Counter>(state, context)->Start();  // lives until gRPC is done with it
//
// gRPC, the mesh and the ticker call it from their own threads. Methods marked (locked) are called
// with the lock held, and may not call the mesh's pool; all others take the lock themselves.
template <typename Request, typename Response>
class ServerStream : public grpc::ServerBidiReactor<Incoming<Request>, Response>,
                     public Stream,
                     public RelayedStream,
                     public std::enable_shared_from_this<ServerStream<Request, Response>> {
 public:
  ServerStream(ServerState& state, grpc::CallbackServerContext* context)
      : state_(state),
        context_(context),
        caller_(Identify(state, *context)),
        peer_(caller_ && caller_->is_passed_on ? caller_->address : context->peer()) {}

  // Reads the first request, or refuses a caller who is not known.
  void Start() {
    self_ = this->shared_from_this();
    state_.streams.Add(self_);
    if (!caller_) return EndWith(caller_.error());
    ReadNext();
  }

  void OnReadDone(bool ok) final {
    if (relay_ != nullptr) return PassOn(ok);
    if (was_routed_) return OnRequest(ok);
    was_routed_ = true;
    const std::string mesh = ok && request() != nullptr ? MeshNamedIn(*request()) : "";
    if (mesh.empty()) return OnRequest(ok);
    {
      const auto lock = Lock();
      is_kept_ = true;
    }
    state_.router.Find(mesh, caller_->is_passed_on, [self = this->shared_from_this()](Route route) {
      self->Follow(std::move(route));
    });
  }

  void OnWriteDone(bool ok) final {
    if (!ok) LeaveAll();
    bool wants_more = false;
    {
      const auto lock = Lock();
      if (phase_ == Phase::kWriting) {
        phase_ = Phase::kIdle;
        wants_more = relay_ != nullptr;
      }
      if (!ok) End(grpc::Status::CANCELLED);
      Pump();
    }
    if (wants_more) relay_->Next();
  }

  void OnCancel() final {
    LeaveAll();
    EndWith(grpc::Status::CANCELLED);
  }

  void OnDone() final {
    LeaveAll();
    std::shared_ptr<ServerStream> self;  // outlives the lock
    const auto lock = Lock();
    phase_ = Phase::kDone;
    self = std::move(self_);
  }

  void Tick(TimePoint now) final {
    if (caller_ && !state_.authenticator->StillHolds(*caller_)) {
      EndWith(TokenWithdrawn());
      LeaveAll();
    }
    const auto lock = Lock();
    if (phase_ == Phase::kDone) return;
    const bool is_sending = phase_ == Phase::kWriting || phase_ == Phase::kFinished;
    const std::chrono::duration<double> unread(state_.config()->unread_seconds);
    if (relay_ != nullptr ? is_sending && now - last_write_ > unread : IsStuck(now))
      return context_->TryCancel();
    if (relay_ == nullptr && !is_kept_) OnTick(now);
  }

  void StopServing() override {
    EndWith(ShuttingDown());  // first: what Leave brings about is no other end
    LeaveAll();
  }

  void OnTaken() final { ReadNext(); }
  void OnAnswer() final {
    const auto lock = Lock();
    has_answer_ = true;
    Pump();
  }
  void OnOver(grpc::Status status) final { EndWith(FromPeer(std::move(status))); }

 protected:
  enum class Step { kWait, kSend, kSendLast };
  enum class Phase {
    kIdle,
    kWriting,   // a message is on its way
    kFinished,  // the end is on its way: nothing follows it
    kDone,      // gRPC has forgotten the call
  };

  // A request has come, or, where `ok` is false, none will come any more.
  virtual void OnRequest(bool ok) = 0;
  // (locked) Fills response(), which is empty, or calls End. Only once a mesh is attached.
  virtual Step Next() = 0;
  // (locked) The same once End was called: the last messages before its status. kWait: none.
  virtual Step AfterEnd() { return Step::kWait; }
  // (locked) Whether the client has exceeded its time, so that the call must be cancelled.
  virtual bool IsStuck(TimePoint now) const = 0;
  // (locked) About once a second. Calls Pump if there may be something to send.
  virtual void OnTick(TimePoint now) = 0;
  // (locked) The stream ends: drop what has not been sent.
  virtual void OnEnd() {}
  // (locked) The last message, or the status, is on its way.
  virtual void OnFinish() {}
  // Releases what the stream holds of the mesh. Called without the lock, any number of times.
  virtual void Leave() {}

  [[nodiscard]] std::unique_lock<std::mutex> Lock() { return std::unique_lock(mutex_); }

  // Makes `session` the stream's mesh, or returns RESOURCE_EXHAUSTED. `part`: bytes of a message.
  grpc::Status Attach(const std::shared_ptr<Session>& session, std::uint64_t part) {
    auto memory = CountStream(state_, *session, part);
    if (!memory) return memory.error();
    const auto lock = Lock();
    memory_ = std::move(*memory);
    last_write_ = Clock::now();
    session_ = session;
    return grpc::Status::OK;
  }

  // Reads another request, unless the stream ends.
  void ReadNext() {
    const auto lock = Lock();
    if (!end_) this->StartRead(&request_);
  }

  // (locked) The first end counts; Pump sends it.
  void End(grpc::Status status) {
    if (end_) return;
    end_ = HasMoved() ? MovedAway() : std::move(status);
    ended_ = Clock::now();
    OnEnd();
  }
  void EndWith(grpc::Status status) {
    const auto lock = Lock();
    End(std::move(status));
    Pump();
  }

  // (locked) Sends the next message, or the end, unless one is on its way.
  void Pump() {
    if (phase_ != Phase::kIdle) return;
    response_.Clear();
    Step step = Step::kWait;
    if (!end_ && HasMoved()) End(MovedAway());
    if (relay_ != nullptr) {
      if (std::exchange(has_answer_, false)) {
        response_.Swap(&relay_->answer());
        step = Step::kSend;
      }
    } else {
      if (!end_ && session_ != nullptr) step = Next();
      if (end_ && !HasMoved()) step = AfterEnd();
    }
    if (!end_ && step == Step::kWait) return;
    last_write_ = Clock::now();
    if (step == Step::kWait || step == Step::kSendLast) {
      phase_ = Phase::kFinished;
      OnFinish();
    }
    if (step == Step::kWait) return this->Finish(*end_);
    state_.metrics.Sent(response_.ByteSizeLong());
    if (step == Step::kSendLast) {
      return this->StartWriteAndFinish(&response_, {}, end_.value_or(grpc::Status::OK));
    }
    phase_ = Phase::kWriting;
    // Never with a buffer hint: gRPC 1.51 may keep such a message, and not call OnWriteDone, until
    // something else goes out on the connection.
    this->StartWrite(&response_);
  }

  ServerState& state() const { return state_; }
  grpc::CallbackServerContext* context() const { return context_; }  // until Phase::kDone
  const std::string& peer() const { return peer_; }
  const Identity& caller() const { return *caller_; }  // once a request has come
  // Null before Attach. For Attach's caller, and (locked) for all others.
  const std::shared_ptr<Session>& session() const { return session_; }
  // In OnReadDone. Null: the message that came is no Request.
  const Request* request() const { return request_.is_valid ? &request_.message : nullptr; }
  Response* response() { return &response_; }

  Phase phase() const { return phase_; }                // (locked)
  bool has_ended() const { return end_.has_value(); }   // (locked) End was called
  TimePoint ended() const { return ended_; }            // (locked) when
  TimePoint last_write() const { return last_write_; }  // (locked) was begun then

 private:
  void LeaveAll() {
    std::shared_ptr<Relay<Request, Response>> relay;
    {
      const auto lock = Lock();
      relay = relay_;
    }
    if (relay != nullptr) relay->Cancel();
    Leave();
  }

  // The first request, where its mesh is.
  void Follow(Route route) {
    {
      const auto lock = Lock();
      is_kept_ = false;
      if (end_) return;
      if (route.kind == Route::Kind::kNotNow) {
        End(MovedAway());
        return Pump();
      }
      if (route.kind == Route::Kind::kThere) {
        relay_ = std::make_shared<Relay<Request, Response>>(route);
        state_.router.Introduce(route, *caller_, peer_, *context_, relay_->context());
        last_write_ = Clock::now();
      }
    }
    if (relay_ == nullptr) return OnRequest(true);
    relay_->Start(this->shared_from_this(), PathOf<Request>());
    relay_->Send(request_.message);
  }

  void PassOn(bool ok) {
    if (!ok) return relay_->SendNoMore();
    if (request() != nullptr) return relay_->Send(request_.message);
    EndWith(NoRequest());
    LeaveAll();
  }

  // (locked) What the stream has of it is no end that a client may hear of.
  bool HasMoved() const { return session_ != nullptr && IsElsewhere(*session_); }

  ServerState& state_;
  grpc::CallbackServerContext* const context_;
  const tl::expected<Identity, grpc::Status> caller_;
  const std::string peer_;  // asked of the context while there surely is a call

  std::mutex mutex_;
  std::shared_ptr<ServerStream> self_;  // until gRPC is done
  std::shared_ptr<Session> session_;
  std::unique_ptr<MemoryBudget::Account> memory_;
  Phase phase_ = Phase::kIdle;
  std::optional<grpc::Status> end_;
  TimePoint ended_, last_write_ = Clock::now();
  Incoming<Request> request_;
  Response response_;
  bool was_routed_ = false;                          // the reading side's alone
  bool is_kept_ = false;                             // until it is known where its mesh is
  bool has_answer_ = false;                          // of the relay
  std::shared_ptr<Relay<Request, Response>> relay_;  // set at most once, before it is started
};

}  // namespace stellate::server
