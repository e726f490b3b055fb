#include <deque>
#include <optional>
#include <unordered_map>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/oracle.h"
#include "server/rpc/rpcs.h"
#include "server/rpc/server_stream.h"
#include "text/printable.h"

namespace stellate::server {
namespace {

constexpr std::size_t kMaxWorkerNameBytes = 128;

// An oracle's own words go to the terminals of others.
std::string WordsOf(const v1::OracleFailure& failure) {
  return Cut(text::PrintableLines(Cut(failure.message(), kMaxFailureBytes)), kMaxFailureBytes);
}

constexpr auto kGoodbye = std::chrono::seconds(5);  // for a client to read the end of its stream

// One worker's stream. gRPC calls the On... functions, the pool Ask and End, the ticker Tick, each
// from its own thread; the lock is never held while calling the pool.
class OracleStream final : public ServerStream<v1::ServeOracleRequest, v1::ServeOracleResponse>,
                           public OracleWorker {
 public:
  using ServerStream::ServerStream;

  void OnRequest(bool ok) override {
    if (!ok) {  // the client has gone, or will say no more
      Leave();
      EndWith(grpc::Status::OK);
      return;
    }
    if (request() == nullptr) {
      return OutOfOrder(
          "a message came that is no ServeOracleRequest of stellate/v1/oracle.proto: see what the "
          "client writes, and that text in it is UTF-8");
    }
    state().metrics.Received(request()->ByteSizeLong());
    Handle(*request());
    ReadNext();
  }

  void Ask(Chunk chunk) override {
    const auto lock = Lock();
    if (has_ended()) return;
    queue_.push_back(std::move(chunk));
    Pump();
  }

  void End(const WorkerEnd& end) override {
    if (!end.blame.ok()) return EndWith(ToGrpc(end.blame));
    const auto lock = Lock();
    if (has_ended()) return;
    over_ = true;
    ServerStream::End(grpc::Status::OK);
    Pump();
  }

  std::string DisplayName() const override {
    return core::Message(text::Printable(worker_name_), worker_name_.empty() ? "at " : " at ",
                         peer());
  }

  TraceHeaders Trace() const override { return caller().trace; }

 private:
  void Handle(const v1::ServeOracleRequest& request) {
    const bool greeted = session() != nullptr;
    switch (request.message_case()) {
      case v1::ServeOracleRequest::kHello:
        if (!greeted) return Greet(request.hello());
        return OutOfOrder("a second Hello came: a stream serves one mesh; open another stream");
      case v1::ServeOracleRequest::kAnswers:
        if (greeted) return TakeAnswers(request.answers());
        return OutOfOrder("answers came before Hello: send Hello first");
      case v1::ServeOracleRequest::kFailure:
        if (greeted) return TakeFailure(request.failure());
        return OutOfOrder("a failure came before Hello: send Hello first");
      case v1::ServeOracleRequest::kBusy:
        if (greeted) return session()->pool().Busy(worker_, request.busy().lease());
        return OutOfOrder("busy came before Hello: send Hello first");
      case v1::ServeOracleRequest::MESSAGE_NOT_SET:
        return OutOfOrder("an empty message came: send hello, answers, failure or busy");
    }
  }

  void OutOfOrder(const std::string& message) {
    EndWith(Refusal(v1::ERROR_REASON_OUT_OF_ORDER, message));
    Leave();
  }

  void Greet(const v1::Hello& hello) {
    const auto mesh = FindMesh(state(), caller(), hello.mesh(), "hello.mesh");
    if (!mesh) return EndWith(mesh.error());
    if ((*mesh)->request().owner != caller().owner) {
      return EndWith(Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                             "the mesh is another owner's: an administrator may see and end it, "
                             "not answer for it",
                             "hello.mesh"));
    }
    if ((*mesh)->request().points) {
      return EndWith(Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                             "the mesh is made of points, and asks no oracle: send them with "
                             "Reconstruct",
                             "hello.mesh"));
    }
    if (hello.worker().size() > kMaxWorkerNameBytes) {
      return EndWith(Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                             core::Message("hello.worker has ", hello.worker().size(),
                                           " bytes but may have ", kMaxWorkerNameBytes),
                             "hello.worker"));
    }
    worker_name_ = hello.worker();
    // Questions are part of the mesh's round.
    if (auto status = Attach(*mesh, 0); !status.ok()) return EndWith(status);
    {
      const auto lock = Lock();
      welcome_ = true;
    }
    // Questions may come before Join returns.
    const auto self = std::static_pointer_cast<OracleStream>(shared_from_this());
    const auto id = session()->pool().Join(self, hello.max_chunk_queries());
    if (!id) {
      const auto lock = Lock();
      welcome_ = false;
      ServerStream::End(Refuse(state(), id.error()));
      return Pump();
    }
    LogThat("worker joined");
    Audit(*session(), caller(), peer(), "serve");
    bool ended = false;
    {
      const auto lock = Lock();
      worker_ = *id;
      ended = has_ended();
      Pump();
    }
    if (ended) Leave();
  }

  void TakeAnswers(const v1::AnswerChunk& answers) {
    NoteAnswer(answers.lease());
    auto chunk = session()->pool().Accept(worker_, answers.lease());
    if (!chunk) return OutOfOrder(chunk.error().message);
    if (!*chunk) return;  // late: another has the work, or it is done
    const auto block = FromProto(answers, **chunk, session()->request().spec);
    const Refused status = block ? session()->pool().Deliver(**chunk, *block) : block.error();
    if (status.ok()) return;
    EndWith(ToGrpc(status));
    session()->pool().Fail(ToMeshFailure(status));
    Leave();
  }

  void NoteAnswer(LeaseId lease) {
    const auto lock = Lock();
    const auto asked = asked_.find(lease);
    if (asked == asked_.end()) return;
    state().metrics.Answered(std::chrono::duration<double>(Clock::now() - asked->second).count());
    asked_.erase(asked);
  }

  void TakeFailure(const v1::OracleFailure& failure) {
    const std::string words =
        failure.message().empty() ? "the oracle failed and did not say why" : WordsOf(failure);
    EndWith(Refusal(v1::ERROR_REASON_ORACLE_FAILED, words));
    session()->pool().Fail({FailureReason::kOracleFailed, words, failure.reason()});
    Leave();
  }

  void Leave() override {
    {
      const auto lock = Lock();
      if (left_ || worker_ == 0) return;
      left_ = true;
    }
    session()->pool().Leave(worker_);
    LogThat("worker left");
  }

  void LogThat(const char* event) const {
    Log(LogLevel::kInfo, session()->log_context(), event,
        LogFields().Add("worker", worker_name_).Add("address", peer()));
  }

  Step Next() override {
    if (welcome_) {
      welcome_ = false;
      ToProto(session()->request().spec, response()->mutable_welcome());
      response()->mutable_welcome()->set_answer_seconds(
          std::chrono::duration<double>(session()->request().timeouts.answer_limit).count());
      return Step::kSend;
    }
    if (queue_.empty()) return Step::kWait;
    ToProto(queue_.front(), session()->request().spec, response()->mutable_queries());
    asked_[queue_.front().lease] = Clock::now();
    queue_.pop_front();
    return Step::kSend;
  }

  // To a worker whose mesh is over: how that ended, and the welcome before, if it is due.
  Step AfterEnd() override {
    if (!over_) return Step::kWait;
    if (welcome_) return Next();
    response()->mutable_over()->set_state(v1::MeshState_Name(ToProto(session()->View().state)));
    return Step::kSendLast;
  }

  void OnEnd() override { queue_.clear(); }

  bool IsStuck(TimePoint now) const override { return has_ended() && now - ended() > kGoodbye; }

  void OnTick(TimePoint now) override {
    const auto patience = std::chrono::duration<double>(state().config()->hello_seconds);
    if (has_ended() || session() != nullptr || now - opened_ <= patience) return;
    ServerStream::End(Refusal(
        v1::ERROR_REASON_OUT_OF_ORDER,
        core::Message("no Hello came within ", patience.count(), " seconds: send it first")));
    Pump();
  }

  const TimePoint opened_ = Clock::now();
  std::string worker_name_;  // the reading side's alone

  // With the lock:
  WorkerId worker_ = 0;   // set once, by Hello
  bool left_ = false;     // the pool
  bool welcome_ = false;  // is due
  bool over_ = false;     // the mesh, and that is why the stream ends
  std::deque<Chunk> queue_;
  std::unordered_map<LeaseId, TimePoint> asked_;  // written, not answered yet
};

}  // namespace

grpc::ServerBidiReactor<Incoming<v1::ServeOracleRequest>, v1::ServeOracleResponse>* ServeOracle(
    ServerState& state, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<OracleStream>(state, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
