#pragma once

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/client_callback.h>

#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "server/rpc/router.h"

namespace stellate::server {

// A stream whose messages go to another server, and come from there. Called on gRPC's threads.
class RelayedStream {
 public:
  virtual ~RelayedStream() = default;
  virtual void OnTaken() = 0;                    // the last message was: another may be sent
  virtual void OnAnswer() = 0;                   // one has come
  virtual void OnOver(grpc::Status status) = 0;  // and nothing more comes
};

// The part of a call between this server and the one that has the mesh. One message is on its way
// in each direction, so that a slow reader at either end holds up the other, and nothing piles up.
//
//   relay->Start(stream); relay->Send(first);
//   OnTaken: relay->Send(next)    OnAnswer: write relay->answer(), then relay->Next()
template <typename Request, typename Response>
class Relay final : public grpc::ClientBidiReactor<Request, Response>,
                    public std::enable_shared_from_this<Relay<Request, Response>> {
 public:
  explicit Relay(Route route) : route_(std::move(route)) {}

  grpc::ClientContext* context() { return &context_; }  // before Start

  // `stream` is kept until the call is over.
  void Start(std::shared_ptr<RelayedStream> stream, const std::string& path) {
    self_ = this->shared_from_this();
    stream_ = std::move(stream);
    grpc::TemplatedGenericStub<Request, Response>(route_.channel)
        .PrepareBidiStreamingCall(&context_, path, {}, this);
    this->AddHold();  // for Send and Next, which come from other threads
    this->StartRead(&answer_);
    this->StartCall();
  }

  // One at a time.
  void Send(const Request& request) {
    const std::lock_guard lock(mutex_);
    if (!is_over_) this->StartWrite(&request);
  }
  void SendNoMore() {
    const std::lock_guard lock(mutex_);
    if (!is_over_) this->StartWritesDone();
  }
  void Next() {
    const std::lock_guard lock(mutex_);
    if (!is_over_) this->StartRead(&answer_);
  }
  void Cancel() { context_.TryCancel(); }
  Response& answer() { return answer_; }

  void OnWriteDone(bool ok) override {
    if (ok) stream_->OnTaken();  // else the read says why
  }
  void OnReadDone(bool ok) override {
    if (ok) return stream_->OnAnswer();
    {
      const std::lock_guard lock(mutex_);
      is_over_ = true;
    }
    this->RemoveHold();
  }
  void OnDone(const grpc::Status& status) override {
    stream_->OnOver(status);
    stream_.reset();
    self_.reset();
  }

 private:
  const Route route_;  // its channel is counted as busy as long
  grpc::ClientContext context_;
  std::shared_ptr<Relay> self_;  // until gRPC is done
  std::shared_ptr<RelayedStream> stream_;
  Response answer_;

  std::mutex mutex_;
  bool is_over_ = false;  // nothing may be started any more
};

}  // namespace stellate::server
