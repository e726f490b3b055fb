#pragma once

#include <grpcpp/client_context.h>

#include <exception>
#include <optional>
#include <string>

#include "stellate/client.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::client {

// One stream of answers. Run blocks its thread; Stop may be called from any other.
class Worker {
 public:
  Worker(v1::Stellate::StubInterface& stub, Oracle& oracle, std::string mesh, std::string name);

  void Run();
  void Stop() { context_.TryCancel(); }

  // After Run. What the oracle threw; else how the stream broke off, unless it ended in order.
  std::exception_ptr exception() const { return exception_; }
  const std::optional<Error>& error() const { return error_; }

 private:
  bool Answer(const v1::QueryChunk& chunk, v1::AnswerChunk* answers);

  v1::Stellate::StubInterface& stub_;
  Oracle& oracle_;
  const std::string mesh_, name_;
  grpc::ClientContext context_;
  std::exception_ptr exception_;
  std::optional<Error> error_;
};

}  // namespace stellate::client
