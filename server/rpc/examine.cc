#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/base/message.h"
#include "server/convert/error_map.h"
#include "server/convert/examination.h"
#include "server/convert/mesh.h"
#include "server/convert/spec.h"
#include "server/rpc/history_stream.h"
#include "server/rpc/rpcs.h"
#include "server/rpc/server_stream.h"
#include "server/session/examined_oracle.h"

namespace stellate::server {
namespace {

// Whoever has an oracle examined serves it: a worker that does not come soon was not able to.
constexpr std::chrono::seconds kWorkerWait{10};

// One client's examination of an oracle: a session of its own, which ends with the stream.
class ExamineStream final : public ServerStream<v1::ExamineRequest, v1::ExamineResponse>,
                            public SessionWatcher {
 public:
  using ServerStream::ServerStream;

  void OnRequest(bool ok) override {
    const bool came = ok && request() != nullptr;
    grpc::Status status = came ? Open(*request()) : NoRequest();
    {
      const auto lock = Lock();
      if (!status.ok()) End(std::move(status));
      Pump();
      if (!has_ended()) return;
    }
    Leave();  // the call ended while its session was being made
  }

  void Wake() override {
    const auto lock = Lock();
    Pump();
  }

 private:
  grpc::Status Open(const v1::ExamineRequest& request) {
    if (state().draining) return ShuttingDown();
    auto parsed = ReadSpec(request.spec(), *state().config());
    if (!parsed) return Refuse(state(), parsed.error(), "spec.");
    if (request.spec().limits().worker_wait_seconds() == 0) {
      auto& wait = parsed->timeouts.worker_wait;
      wait = std::min<decltype(parsed->timeouts.worker_wait)>(wait, kWorkerWait);
    }
    std::optional<double> epsilon;
    if (parsed->spec.epsilon != 0) epsilon = parsed->spec.epsilon;
    auto oracle = std::make_shared<ExaminedOracle>(parsed->spec, epsilon);
    if (!oracle->asks()) {
      const auto lock = Lock();
      oracle_ = std::move(oracle);
      asked_nothing_ = true;
      End(grpc::Status::OK);
      return grpc::Status::OK;
    }
    // As a mesh of that epsilon, whatever it is where none is planned.
    core::Specification as_mesh = parsed->spec;
    if (!epsilon) as_mesh.epsilon = 1;
    if (const core::Status status = core::Validate(as_mesh); !status.ok())
      return Refuse(state(), Refused(status), "spec.");
    return Begin(std::move(*parsed), std::move(oracle));
  }

  grpc::Status Begin(MeshRequest request, std::shared_ptr<ExaminedOracle> oracle) {
    SessionOptions options;
    options.request = std::move(request);
    options.request.owner = caller().owner;
    options.request.trace = caller().trace;
    options.request.name = state().router.NewName();
    options.examiner = oracle->Examiner();
    ApplyServerPolicy(state(), &options);
    options.policy.dispatch.is_examination = true;
    options.policy.dispatch.check_share = 0;
    options.policy.max_workers = 1;  // there is an oracle to compare with: itself
    if (auto full = options.ports.memory->Set(EstimateMeshBytes(options.request.spec, 0, 0)))
      return Refuse(state(), *full);
    const auto session = state().store.Create(std::move(options));
    if (!session) return Refuse(state(), session.error());
    const std::string& name = (*session)->request().name;
    {
      const auto lock = Lock();
      oracle_ = std::move(oracle);  // before Next is called
    }
    if (auto status = Attach(*session, 0); !status.ok()) {
      state().store.Delete(name);
      return status;
    }
    {
      const auto lock = Lock();
      name_ = name;
    }
    (*session)->history().AddWatcher(
        std::static_pointer_cast<ExamineStream>(this->shared_from_this()));
    Audit(**session, caller(), peer(), "examine");
    return grpc::Status::OK;
  }

  Step Next() override {
    if (!was_named_) {
      was_named_ = true;
      ToProto(*session(), response()->mutable_mesh());
      return Step::kSend;
    }
    const bool is_over = session()->HasEnded();  // before the findings: nothing follows then
    if (is_over && !report_ && !Conclude(session()->View())) return Step::kWait;
    if (SendFinding()) return Step::kSend;
    if (!is_over) return Step::kWait;
    *response()->mutable_report() = std::move(*report_);
    return Step::kSendLast;
  }

  // False: it ended with nothing to report, and End was called.
  bool Conclude(const SessionView& view) {
    const MeshFailure& failure = view.failure;
    if (view.state == SessionState::kCancelled) {
      End({grpc::StatusCode::CANCELLED, "the examination was cancelled by its name"});
      return false;
    }
    if (view.state == SessionState::kFailed && !IsFaultOfOracle(failure)) {
      End(Failed(failure));
      return false;
    }
    ToProto(oracle_->Conclude(failure), &report_.emplace());
    return true;
  }

  // What an examination may fail by, besides the oracle.
  static grpc::Status Failed(const MeshFailure& failure) {
    switch (failure.reason) {
      case FailureReason::kNoWorker:
        return Refusal(v1::ERROR_REASON_NO_WORKER, failure.message);
      case FailureReason::kLimitExceeded:
        return Refusal(v1::ERROR_REASON_LIMIT_EXCEEDED, failure.message);
      default:
        return Refusal(v1::ERROR_REASON_INTERNAL, failure.message);
    }
  }

  bool SendFinding() {
    const auto news = oracle_->FindingsFrom(sent_);
    if (news.empty()) return false;
    ToProto(news.front(), response()->mutable_finding());
    ++sent_;
    return true;
  }

  // Of an examination that had nothing to ask.
  Step AfterEnd() override {
    if (!asked_nothing_) return Step::kWait;
    if (SendFinding()) return Step::kSend;
    ToProto(oracle_->Conclude({}), response()->mutable_report());
    return Step::kSendLast;
  }

  bool IsStuck(TimePoint now) const override {
    const bool is_sending = phase() == Phase::kWriting || phase() == Phase::kFinished;
    return is_sending && now - last_write() > kUnreadPatience;
  }

  void OnTick(TimePoint /*now*/) override { Pump(); }

  void Leave() override {
    std::string name;
    {
      const auto lock = Lock();
      if (session() == nullptr) return;
      name = std::exchange(name_, "");
    }
    if (!name.empty()) state().store.Delete(name);
  }

  // With the lock:
  std::string name_;  // of the session; empty: none, or it was deleted
  std::shared_ptr<ExaminedOracle> oracle_;
  bool asked_nothing_ = false;  // and there is no session
  bool was_named_ = false;
  std::size_t sent_ = 0;  // findings
  std::optional<v1::CheckReport> report_;
};

}  // namespace

grpc::ServerBidiReactor<Incoming<v1::ExamineRequest>, v1::ExamineResponse>* Examine(
    ServerState& state, grpc::CallbackServerContext* context) {
  const auto stream = std::make_shared<ExamineStream>(state, context);
  stream->Start();
  return stream.get();
}

}  // namespace stellate::server
