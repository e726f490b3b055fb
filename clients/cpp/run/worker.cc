#include "run/worker.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "net/channel.h"
#include "run/answer_chunk.h"
#include "wire/convert.h"
#include "wire/status.h"

namespace stellate::client {
namespace {

constexpr size_t kChunkBytes = 3 << 20;  // of numbers, under the 4 MB of a message
constexpr auto kLookAgain = std::chrono::milliseconds(100);
constexpr double kBusyShare = 0.25;        // of the time that the server bears silence
constexpr size_t kMaxFailureBytes = 4000;  // OracleFailure.message takes 4096

std::uint32_t MaxChunkQueries(const Oracle& oracle) {
  const size_t d = static_cast<size_t>(oracle.ambient_dimension());
  const size_t k = static_cast<size_t>(oracle.dimension());
  const size_t walls = static_cast<size_t>(oracle.walls());
  const size_t numbers = d + d * (k + std::min(k, walls)) + walls + 2;
  return static_cast<std::uint32_t>(std::max<size_t>(1, kChunkBytes / (8 * numbers)));
}

void Describe(const std::exception_ptr& exception, v1::OracleFailure* failure) {
  std::string what = "an exception that is no std::exception";
  try {
    std::rethrow_exception(exception);
  } catch (const OracleError& e) {
    failure->set_reason(e.reason());
    what = e.what();
  } catch (const std::exception& e) {
    what = e.what();
  } catch (...) {
  }
  failure->set_message(what.substr(0, kMaxFailureBytes));
}

void NoteEnd(const v1::ServeOracleResponse& response, std::optional<MeshState>* state) {
  if (!response.has_over()) return;
  v1::MeshState parsed =
      v1::MESH_STATE_UNSPECIFIED;  // also of a state that this client is too old for
  v1::MeshState_Parse(response.over().state(), &parsed);
  *state = FromProto(parsed);
}

using Stream = grpc::ClientReaderWriterInterface<v1::ServeOracleRequest, v1::ServeOracleResponse>;

// What is sent to the server. While the oracle is at a chunk another thread says so now and then,
// so that the server does not take a slow worker for a dead one.
class Outbox {
 public:
  explicit Outbox(Stream& stream) : stream_(stream) {}

  bool Write(const v1::ServeOracleRequest& request) {
    const std::lock_guard lock(mutex_);
    busy_with_.reset();
    return stream_.Write(request);
  }

  void End() {
    const std::lock_guard lock(mutex_);
    busy_with_.reset();
    stream_.WritesDone();
  }

  // The oracle is at the chunk, until the next Write.
  void Begin(std::uint64_t lease) {
    const std::lock_guard lock(mutex_);
    busy_with_ = lease;
  }

  // Says so every `interval`, from now on.
  void SayBusyEvery(Seconds interval) {
    if (teller_.joinable()) return;
    teller_ = std::jthread([this, interval](const std::stop_token& stop) {
      std::unique_lock lock(mutex_);
      while (!wake_.wait_for(lock, stop, interval, [&stop] { return stop.stop_requested(); })) {
        if (!busy_with_) continue;
        v1::ServeOracleRequest request;
        request.mutable_busy()->set_lease(*busy_with_);
        stream_.Write(request);
      }
    });
  }

 private:
  Stream& stream_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::optional<std::uint64_t> busy_with_;
  std::jthread teller_;  // joined before the rest goes
};

// What the server sent, read on a thread of its own: the next chunk is on its way while one is
// answered. The server bounds how many there can be.
class Inbox {
 public:
  explicit Inbox(Stream& stream) : reader_([this, &stream] { ReadAll(stream); }) {}

  // False at the end of the stream.
  bool Next(v1::ServeOracleResponse* response) {
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [this] { return ended_ || !unread_.empty(); });
    if (unread_.empty()) return false;
    response->Swap(&unread_.front());
    unread_.pop_front();
    return true;
  }

 private:
  void ReadAll(Stream& stream) {
    v1::ServeOracleResponse response;
    while (stream.Read(&response)) {
      const std::lock_guard lock(mutex_);
      unread_.emplace_back().Swap(&response);
      wake_.notify_one();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    wake_.notify_one();
  }

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<v1::ServeOracleResponse> unread_;
  bool ended_ = false;
  std::jthread reader_;  // joined before the rest goes
};

}  // namespace

Worker::Worker(v1::Stellate::StubInterface& stub, Oracle& oracle, std::string mesh,
               std::string name, ReconnectPolicy policy, std::optional<std::uint32_t> max_chunk)
    : stub_(stub),
      oracle_(oracle),
      mesh_(std::move(mesh)),
      name_(std::move(name)),
      max_chunk_(std::min(MaxChunkQueries(oracle), max_chunk.value_or(MaxChunkQueries(oracle)))),
      attempts_(std::move(policy)) {}

// Sets exception_, and makes the request say so, when the oracle throws. False, with error_ set:
// nothing to send.
bool Worker::AnswerOrFail(const v1::QueryChunk& chunk, v1::ServeOracleRequest* request) {
  request->Clear();
  try {
    if (AnswerChunk(oracle_, chunk, request->mutable_answers())) return true;
    error_ = BrokenProtocol("queries that make no sense");
    return false;
  } catch (...) {
    exception_ = std::current_exception();
    request->Clear();
    request->mutable_failure()->set_lease(chunk.lease());
    Describe(exception_, request->mutable_failure());
    return true;
  }
}

grpc::Status Worker::Serve() {
  const auto stream = stub_.ServeOracle(&attempts_.Attempt());
  v1::ServeOracleRequest request;
  request.mutable_hello()->set_mesh(mesh_);
  request.mutable_hello()->set_worker(name_);
  request.mutable_hello()->set_max_chunk_queries(max_chunk_);
  bool open = stream->Write(request);
  {
    Inbox inbox(*stream);
    Outbox outbox(*stream);
    v1::ServeOracleResponse response;
    while (open && !exception_ && inbox.Next(&response)) {
      attempts_.Heard();
      NoteEnd(response, &state_);
      if (response.has_over()) break;  // our half ends first
      if (response.has_welcome() && !Suits(response.welcome())) {
        attempts_.Stop();
        break;
      }
      if (response.welcome().answer_seconds() > 0) {
        outbox.SayBusyEvery(Seconds(kBusyShare * response.welcome().answer_seconds()));
      }
      if (!response.has_queries()) continue;
      outbox.Begin(response.queries().lease());
      if (!AnswerOrFail(response.queries(), &request)) {
        attempts_.Stop();
        break;
      }
      open = outbox.Write(request);
    }
    outbox.End();
    // What is left unread would keep Finish from returning.
    while (inbox.Next(&response)) NoteEnd(response, &state_);
  }
  return stream->Finish();
}

// False, with error_ set, when this oracle is not of the mesh's kind: others may be.
bool Worker::Suits(const v1::Welcome& welcome) {
  const auto k = static_cast<std::uint32_t>(oracle_.dimension());
  const auto d = static_cast<std::uint32_t>(oracle_.ambient_dimension());
  std::string problem;
  if (welcome.dimension() != k || welcome.ambient_dimension() != d) {
    const auto space = [](std::uint32_t its_k, std::uint32_t its_d) {
      return "dimension " + std::to_string(its_k) + " in R^" + std::to_string(its_d);
    };
    problem = "the mesh has " + space(welcome.dimension(), welcome.ambient_dimension()) +
              ", and this oracle's manifold has " + space(k, d);
  } else if (welcome.walls() != static_cast<std::uint32_t>(oracle_.walls())) {
    problem = "the mesh has " + std::to_string(welcome.walls()) +
              " walls, and this oracle's manifold " + std::to_string(oracle_.walls());
  } else {
    const struct {
      std::string name;
      bool asked, able;
    } abilities[] = {
        {"intersect_flat", welcome.oracle().intersect_flat(), oracle_.has_intersect_flat()},
        {"tangent_basis", welcome.oracle().tangent_basis(), oracle_.has_tangent_basis()},
        {"local_size", welcome.oracle().local_size(), oracle_.has_local_size()}};
    std::string missing;
    for (const auto& [name, asked, able] : abilities) {
      if (asked && !able) missing += (missing.empty() ? "" : " and ") + name;
    }
    if (!missing.empty()) {
      problem = "the mesh was declared with " + missing + ", which this oracle lacks";
    }
  }
  if (problem.empty()) return true;
  error_ = Error{ErrorCode::kRefused, "INVALID_ARGUMENT",
                 problem + ": all workers of a mesh have to serve one manifold"};
  return false;
}

// Of a mesh that takes no more workers; nothing if that cannot be found out.
std::optional<MeshState> Worker::HowItEnded() {
  v1::GetMeshRequest request;
  request.set_name(mesh_);
  const auto give_up = std::chrono::steady_clock::now() + kCallTime;
  do {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kCallTime);
    v1::Mesh mesh;
    if (!stub_.GetMesh(&context, request, &mesh).ok()) break;
    if (mesh.has_end_time()) return FromProto(mesh.state());
    // It is just about to end.
  } while (std::chrono::steady_clock::now() < give_up && attempts_.Pause(kLookAgain));
  return std::nullopt;
}

void Worker::Run() {
  while (true) {
    const grpc::Status status = Serve();
    if (exception_ || error_ || state_ || status.ok()) return;
    if (status.error_code() == grpc::StatusCode::FAILED_PRECONDITION) {
      state_ = HowItEnded();  // before this worker came, or while it was away
      if (state_) return;
    }
    if (attempts_.Again(status)) continue;
    error_ = Explain(status, attempts_.reconnecting());
    return;
  }
}

}  // namespace stellate::client
