#include <deque>
#include <optional>
#include <unordered_map>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/mesh.h"
#include "server/convert/oracle.h"
#include "server/rpc/rpcs.h"
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
// from its own thread; the lock guards what they share and is never held while calling the pool.
class OracleStream final
    : public grpc::ServerBidiReactor<v1::ServeOracleRequest, v1::ServeOracleResponse>,
      public OracleWorker,
      public Stream,
      public std::enable_shared_from_this<OracleStream> {
 public:
  OracleStream(ServerState& state, grpc::CallbackServerContext* context)
      : state_(state),
        context_(context),
        peer_(context->peer()),
        caller_(Identify(state, *context)),
        opened_(Clock::now()) {}

  void Start() {
    self_ = shared_from_this();
    state_.streams.Add(self_);
    if (!caller_) return EndWith(caller_.error());
    ReadNext();
  }

  void OnReadDone(bool ok) override {
    if (!ok) {  // the client has gone, or will say no more
      Leave();
      EndWith(grpc::Status::OK);
      return;
    }
    state_.metrics.Received(request_.ByteSizeLong());
    Handle(request_);
    ReadNext();
  }

  void OnWriteDone(bool ok) override {
    if (!ok) {
      Leave();
      EndWith(grpc::Status::CANCELLED);
    }
    const std::lock_guard lock(mutex_);
    writing_ = false;
    Pump();
  }

  void OnCancel() override {
    Leave();
    EndWith(grpc::Status::CANCELLED);
  }

  void OnDone() override {
    Leave();
    std::shared_ptr<OracleStream> self;  // outlives the lock
    const std::lock_guard lock(mutex_);
    done_ = true;
    self = std::move(self_);
  }

  void Ask(Chunk chunk) override {
    const std::lock_guard lock(mutex_);
    if (end_) return;
    queue_.push_back(std::move(chunk));
    Pump();
  }

  void End(const WorkerEnd& end) override {
    if (end.blame.ok()) {
      EndWith(grpc::Status::OK, /*mesh_over=*/true);
    } else {
      EndWith(ToGrpc(end.blame));
    }
  }

  std::string Title() const override {
    return core::Message(text::Printable(worker_name_), worker_name_.empty() ? "at " : " at ",
                         peer_);
  }

  void Tick(TimePoint now) override {
    const auto patience = std::chrono::duration<double>(state_.config.hello_seconds);
    if (caller_ && !state_.authenticator->StillHolds(*caller_)) {
      EndWith(TokenWithdrawn());
      Leave();
    }
    const std::lock_guard lock(mutex_);
    if (done_) return;
    if (end_) {
      if (now - ended_ > kGoodbye) context_->TryCancel();
    } else if (session_ == nullptr && now - opened_ > patience) {
      EndLocked(Refusal(v1::ERROR_REASON_OUT_OF_ORDER,
                        core::Message("no Hello came within ", patience.count(),
                                      " seconds: send it first")),
                false);
    }
  }

  void StopServing() override {
    Leave();
    EndWith(ShuttingDown());
  }

 private:
  void ReadNext() {
    const std::lock_guard lock(mutex_);
    if (!end_) StartRead(&request_);
  }

  void Handle(const v1::ServeOracleRequest& request) {
    const bool greeted = session_ != nullptr;
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
        if (greeted) return session_->pool().Busy(worker_, request.busy().lease());
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
    auto session = FindMesh(state_, *caller_, hello.mesh(), "hello.mesh");
    if (!session) return EndWith(session.error());
    if ((*session)->request().owner != caller_->owner) {
      return EndWith(Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                             "the mesh is another owner's: an administrator may see and end it, "
                             "not answer for it",
                             "hello.mesh"));
    }
    if (hello.worker().size() > kMaxWorkerNameBytes) {
      return EndWith(Refusal(v1::ERROR_REASON_INVALID_ARGUMENT,
                             core::Message("hello.worker has ", hello.worker().size(),
                                           " bytes but may have ", kMaxWorkerNameBytes),
                             "hello.worker"));
    }
    auto memory = CountStream(state_, **session, 0);  // questions are part of the mesh's round
    if (!memory) return EndWith(memory.error());
    worker_name_ = hello.worker();
    {
      const std::lock_guard lock(mutex_);
      session_ = *session;
      memory_ = std::move(*memory);
      welcome_ = true;
    }
    // Questions may come before Join returns.
    const auto id = session_->pool().Join(shared_from_this(), hello.max_chunk_queries());
    if (!id) {
      const std::lock_guard lock(mutex_);
      welcome_ = false;
      EndLocked(Refuse(state_, id.error()), false);
      return;
    }
    Log(LogLevel::kInfo, session_->log_context(), "worker joined",
        LogFields().Add("worker", worker_name_).Add("address", peer_));
    Audit(*session_, *caller_, peer_, "serve");
    bool ended = false;
    {
      const std::lock_guard lock(mutex_);
      worker_ = *id;
      ended = end_.has_value();
      Pump();
    }
    if (ended) Leave();
  }

  void TakeAnswers(const v1::AnswerChunk& answers) {
    NoteAnswer(answers.lease());
    auto chunk = session_->pool().Claim(worker_, answers.lease());
    if (!chunk) return OutOfOrder(chunk.error().message);
    if (!*chunk) return;  // late: another has the work, or it is done
    const auto block = FromProto(answers, **chunk, session_->request().spec);
    const Refused status = block ? session_->pool().Deliver(**chunk, *block) : block.error();
    if (status.ok()) return;
    EndWith(ToGrpc(status));
    session_->pool().Fail(ToMeshFailure(status));
    Leave();
  }

  void NoteAnswer(LeaseId lease) {
    const std::lock_guard lock(mutex_);
    const auto asked = asked_.find(lease);
    if (asked == asked_.end()) return;
    state_.metrics.Answered(std::chrono::duration<double>(Clock::now() - asked->second).count());
    asked_.erase(asked);
  }

  void TakeFailure(const v1::OracleFailure& failure) {
    const std::string words =
        failure.message().empty() ? "the oracle failed and did not say why" : WordsOf(failure);
    EndWith(Refusal(v1::ERROR_REASON_ORACLE_FAILED, words));
    session_->pool().Fail({FailureReason::kOracleFailed, words});
    Leave();
  }

  // Gives its work back. Any number of times.
  void Leave() {
    WorkerId worker = 0;
    {
      const std::lock_guard lock(mutex_);
      worker = worker_;
      if (left_ || worker == 0) return;
      left_ = true;
    }
    session_->pool().Leave(worker);
    Log(LogLevel::kInfo, session_->log_context(), "worker left",
        LogFields().Add("worker", worker_name_).Add("address", peer_));
  }

  void EndWith(grpc::Status status, bool mesh_over = false) {
    const std::lock_guard lock(mutex_);
    EndLocked(std::move(status), mesh_over);
  }

  // The first end counts.
  void EndLocked(grpc::Status status, bool mesh_over) {
    if (end_) return;
    end_ = std::move(status);
    over_ = mesh_over;
    ended_ = Clock::now();
    queue_.clear();
    Pump();
  }

  // Starts the next write, or the end, if none is on its way.
  void Pump() {
    if (writing_ || finished_) return;
    if (welcome_ && (!end_ || over_)) {
      welcome_ = false;
      response_.Clear();
      ToProto(session_->request().spec, response_.mutable_welcome());
      response_.mutable_welcome()->set_answer_seconds(
          std::chrono::duration<double>(session_->request().timeouts.answer_limit).count());
    } else if (end_) {
      finished_ = true;
      if (!over_) return Finish(*end_);
      response_.Clear();
      response_.mutable_over()->set_state(v1::MeshState_Name(ToProto(session_->View().state)));
      state_.metrics.Sent(response_.ByteSizeLong());
      return StartWriteAndFinish(&response_, grpc::WriteOptions(), *end_);
    } else if (!queue_.empty()) {
      response_.Clear();
      ToProto(queue_.front(), session_->request().spec, response_.mutable_queries());
      asked_[queue_.front().lease] = Clock::now();
      queue_.pop_front();
    } else {
      return;
    }
    writing_ = true;
    state_.metrics.Sent(response_.ByteSizeLong());
    StartWrite(&response_);
  }

  ServerState& state_;
  grpc::CallbackServerContext* const context_;
  const std::string peer_;  // asked of the context while there surely is a call
  const tl::expected<Identity, grpc::Status> caller_;
  const TimePoint opened_;
  v1::ServeOracleRequest request_;  // the reading side's alone, as are the next
  std::string worker_name_;

  std::mutex mutex_;
  std::shared_ptr<OracleStream> self_;
  std::shared_ptr<Session> session_;  // set once, by Hello
  std::unique_ptr<MemoryBudget::Account> memory_;
  WorkerId worker_ = 0;  // set once, by Hello
  bool left_ = false;
  bool welcome_ = false;
  bool writing_ = false;
  bool finished_ = false;
  bool done_ = false;
  bool over_ = false;
  std::optional<grpc::Status> end_;
  TimePoint ended_;
  std::deque<Chunk> queue_;
  std::unordered_map<LeaseId, TimePoint> asked_;  // written, not answered yet
  v1::ServeOracleResponse response_;
};

}  // namespace

grpc::ServerBidiReactor<v1::ServeOracleRequest, v1::ServeOracleResponse>* ServeOracle(
    ServerState& state, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<OracleStream>(state, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
