#pragma once

#include <grpcpp/create_channel.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "tests/server/support/live_server.h"

namespace stellate::server::testing {

// A worker that comes back whenever its stream breaks, until its mesh is over: answers truly, at
// the pace of an oracle that has something to do.
class PersistentWorker {
 public:
  PersistentWorker(const std::string& address, std::string mesh) : mesh_(std::move(mesh)) {
    grpc::ChannelArguments arguments;
    arguments.SetInt("grpc.use_local_subchannel_pool", 1);
    arguments.SetInt("grpc.initial_reconnect_backoff_ms", 20);
    arguments.SetInt("grpc.max_reconnect_backoff_ms", 100);
    arguments.SetInt("grpc.min_reconnect_backoff_ms", 20);
    stub_ = v1::Stellate::NewStub(
        grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments));
    thread_ = std::thread([this] { ServeOn(); });
  }
  ~PersistentWorker() {
    stopping_ = true;
    Wait();
  }
  // Until the mesh is over, or this worker is asked to stop.
  void Wait() {
    if (thread_.joinable()) thread_.join();
  }

 private:
  void ServeOn() {
    while (!stopping_ && !over_) {
      Serve();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  void Serve() {
    grpc::ClientContext context;
    const std::jthread watchdog([this, &context](std::stop_token done) {
      while (!stopping_ && !done.stop_requested()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
      if (stopping_) context.TryCancel();
    });
    const auto stream = stub_->ServeOracle(&context);
    v1::ServeOracleRequest hello;
    hello.mutable_hello()->set_mesh(mesh_);
    stream->Write(hello);
    v1::ServeOracleResponse response;
    while (stream->Read(&response)) {
      if (response.has_over()) over_ = true;
      if (!response.has_queries()) continue;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      stream->Write(*RawWorker::Truly(response.queries()));
    }
    const grpc::StatusCode code = stream->Finish().error_code();
    if (code == grpc::StatusCode::FAILED_PRECONDITION || code == grpc::StatusCode::NOT_FOUND) {
      over_ = true;  // the mesh ended, or is gone, while the link was down
    }
  }

  const std::string mesh_;
  std::unique_ptr<v1::Stellate::Stub> stub_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> over_{false};
  std::thread thread_;
};

}  // namespace stellate::server::testing
