#pragma once

#include <exception>
#include <optional>
#include <string>

#include "net/reconnect.h"
#include "stellate/client.h"
#include "stellate/monitor.h"
#include "stellate/v1/stellate.grpc.pb.h"

namespace stellate::client {

// Answers for one mesh until it is over, over one stream at a time. Run blocks its thread, and has
// a second one read ahead; the others may be called from any thread.
class Worker {
 public:
  Worker(v1::Stellate::StubInterface& stub, Oracle& oracle, std::string mesh, std::string name,
         ReconnectPolicy policy = {}, std::optional<std::uint32_t> max_chunk = {});

  void Run();
  // Ends the stream: what is unanswered goes to another worker.
  void Stop() { attempts_.Stop(); }
  // The mesh is over: a lost stream is not opened again.
  void Finish() { attempts_.Finish(); }

  // After Run: the state that the mesh ended in, unless this worker left before.
  std::optional<MeshState> state() const { return state_; }
  // Else what the oracle threw; else how the last stream broke off, unless it ended in order.
  std::exception_ptr exception() const { return exception_; }
  const std::optional<Error>& error() const { return error_; }

 private:
  grpc::Status Serve();
  bool Suits(const v1::Welcome& welcome);
  std::optional<MeshState> HowItEnded();
  bool AnswerOrFail(const v1::QueryChunk& chunk, v1::ServeOracleRequest* request);

  v1::Stellate::StubInterface& stub_;
  Oracle& oracle_;
  const std::string mesh_, name_;
  const std::uint32_t max_chunk_;
  Reconnector attempts_;
  std::optional<MeshState> state_;
  std::exception_ptr exception_;
  std::optional<Error> error_;
};

}  // namespace stellate::client
