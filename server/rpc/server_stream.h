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
#include "server/rpc/streams.h"

namespace stellate::server {

// The skeleton of a streaming call: identifies the caller, keeps at most one message on its way,
// and ends the call once, for the first of all reasons that the client, the mesh, the ticker and
// the server may have. A subclass takes requests, attaches the stream to a mesh, and fills the
// messages:
//
//   class Counter final : public ServerStream<Request, Response> {
//     void OnReadDone(bool ok) override { ... request() Attach(mesh, bytes); ReadNext(); }
//     Step Next() override { response()->set_count(++count_); return Step::kSend; }
//   };
//   std::make_shared<Counter>(state, context)->Start();  // lives until gRPC is done with it
//
// gRPC, the mesh and the ticker call it from their own threads. Methods marked (locked) are called
// with the lock held, and may not call the mesh's pool; all others take the lock themselves.
template <typename Request, typename Response>
class ServerStream : public grpc::ServerBidiReactor<Incoming<Request>, Response>,
                     public Stream,
                     public std::enable_shared_from_this<ServerStream<Request, Response>> {
 public:
  ServerStream(ServerState& state, grpc::CallbackServerContext* context)
      : state_(state),
        context_(context),
        peer_(context->peer()),
        caller_(Identify(state, *context)) {}

  // Reads the first request, or refuses a caller who is not known.
  void Start() {
    self_ = this->shared_from_this();
    state_.streams.Add(self_);
    if (!caller_) return EndWith(caller_.error());
    ReadNext();
  }

  void OnWriteDone(bool ok) final {
    if (!ok) Leave();
    const auto lock = Lock();
    if (phase_ == Phase::kWriting) phase_ = Phase::kIdle;
    if (!ok) End(grpc::Status::CANCELLED);
    Pump();
  }

  void OnCancel() final {
    Leave();
    EndWith(grpc::Status::CANCELLED);
  }

  void OnDone() final {
    Leave();
    std::shared_ptr<ServerStream> self;  // outlives the lock
    const auto lock = Lock();
    phase_ = Phase::kDone;
    self = std::move(self_);
  }

  void Tick(TimePoint now) final {
    if (caller_ && !state_.authenticator->StillHolds(*caller_)) {
      EndWith(TokenWithdrawn());
      Leave();
    }
    const auto lock = Lock();
    if (phase_ == Phase::kDone) return;
    if (IsStuck(now)) return context_->TryCancel();
    OnTick(now);
  }

  void StopServing() override {
    EndWith(ShuttingDown());  // first: what Leave brings about is no other end
    Leave();
  }

 protected:
  enum class Step { kWait, kSend, kSendLast };
  enum class Phase {
    kIdle,
    kWriting,   // a message is on its way
    kFinished,  // the end is on its way: nothing follows it
    kDone,      // gRPC has forgotten the call
  };

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
    end_ = std::move(status);
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
    if (!end_ && session_ != nullptr) step = Next();
    if (end_) step = AfterEnd();
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
  ServerState& state_;
  grpc::CallbackServerContext* const context_;
  const std::string peer_;  // asked of the context while there surely is a call
  const tl::expected<Identity, grpc::Status> caller_;

  std::mutex mutex_;
  std::shared_ptr<ServerStream> self_;  // until gRPC is done
  std::shared_ptr<Session> session_;
  std::unique_ptr<MemoryBudget::Account> memory_;
  Phase phase_ = Phase::kIdle;
  std::optional<grpc::Status> end_;
  TimePoint ended_, last_write_ = Clock::now();
  Incoming<Request> request_;
  Response response_;
};

}  // namespace stellate::server
