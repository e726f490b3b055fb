#include "server/session.h"

#include <algorithm>
#include <exception>
#include <new>
#include <utility>

#include "core/message.h"

namespace stellate::server {
namespace {

using core::StatusCode;

MeshFailure ToFailure(const core::Status& status) {
  return {core::StatusCodeName(status.code), status.message};
}

}  // namespace

const char* SessionStateName(SessionState state) {
  switch (state) {
    case SessionState::kWaiting:
      return "WAITING";
    case SessionState::kRunning:
      return "RUNNING";
    case SessionState::kSucceeded:
      return "SUCCEEDED";
    case SessionState::kStopped:
      return "STOPPED";
    case SessionState::kCancelled:
      return "CANCELLED";
    case SessionState::kFailed:
      return "FAILED";
  }
  return "UNKNOWN";
}

Session::Session(SessionOptions options, MesherFactory factory)
    : options_(std::move(options)),
      factory_(std::move(factory)),
      pool_(options_.spec, options_.dispatch, options_.max_workers),
      history_(options_.spec.dimension, options_.spec.ambient_dimension),
      create_time_(std::chrono::system_clock::now()),
      created_(Clock::now()) {}

void Session::Run() {
  std::unique_ptr<core::Mesher> mesher;
  std::optional<core::Report> report;
  try {
    auto made = factory_(options_.spec);
    if (made) {
      mesher = std::move(*made);
      RunRounds(mesher.get());
      report = mesher->report();
    } else {
      Fail(nullptr, ToFailure(made.error()), made.error());
    }
  } catch (const std::bad_alloc&) {
    Fail(nullptr,
         {"LIMIT_EXCEEDED",
          "the server ran out of memory for this mesh: ask for a larger epsilon "
          "or fewer vertices"},
         core::Status::Ok());
  } catch (const std::exception& error) {
    Fail(nullptr, {"INTERNAL", core::Message("a fault of the server: ", error.what())},
         core::Status::Ok());
  }
  mesher.reset();  // it is large, and watchers do not need it
  Finish(report ? &*report : nullptr);
}

void Session::RunRounds(core::Mesher* mesher) {
  Log(LogLevel::kInfo, log_context(),
      core::Message("meshing ", options_.label, options_.label.empty() ? "k = " : ": k = ",
                    options_.spec.dimension, ", d = ", options_.spec.ambient_dimension,
                    ", epsilon = ", options_.spec.epsilon));
  while (true) {
    if (cancelled_) mesher->Cancel();
    const core::QueryBatch* const batch = mesher->NextBatch();
    Publish(mesher->progress());
    if (batch == nullptr) return;
    RunRound(mesher, *batch);
  }
}

void Session::RunRound(core::Mesher* mesher, const core::QueryBatch& batch) {
  OraclePool::Outcome outcome = pool_.Ask(batch);
  if (outcome.failure) {
    // The worker at fault has been told on its own stream; the others are blameless.
    core::Status status{StatusCode::kOracleFailed, outcome.failure->message};
    Fail(mesher, std::move(*outcome.failure), std::move(status));
    blame_ = core::Status::Ok();
    return;
  }
  if (!outcome.round) return;  // interrupted: the caller cancels
  const auto delta = mesher->Absorb(outcome.round->answers);
  if (!delta) {
    Fail(mesher, ToFailure(delta.error()), delta.error());
    return;
  }
  const core::Status logged = history_.Append(*delta);
  if (!logged.ok()) {
    Fail(mesher, {"INTERNAL", core::Message("a fault of the server: ", logged.message)}, logged);
    blame_ = core::Status::Ok();
    return;
  }
  if (options_.observer != nullptr) options_.observer->OnRound(batch.size());
  if (LogEnabled(LogLevel::kDebug)) {
    Log(LogLevel::kDebug, {options_.name, batch.round},
        core::Message(batch.size(), " queries answered, ", mesher->progress().vertices,
                      " vertices"));
  }
}

void Session::Fail(core::Mesher* mesher, MeshFailure failure, core::Status status) {
  {
    const std::lock_guard lock(mutex_);
    failure_ = std::move(failure);
  }
  blame_ = status;
  if (mesher != nullptr) mesher->Fail(std::move(status));
}

void Session::Publish(const core::Progress& progress) {
  {
    const std::lock_guard lock(mutex_);
    progress_ = progress;
  }
  WakeWatchers();
}

SessionState Session::FinalState(const core::Report* report) const {
  if (!failure_.reason.empty()) return SessionState::kFailed;
  if (cancelled_ || report == nullptr) return SessionState::kCancelled;
  switch (report->termination) {
    case core::Termination::kConverged:
      return SessionState::kSucceeded;
    case core::Termination::kCancelled:
      return SessionState::kCancelled;
    case core::Termination::kOracleFailed:
      return SessionState::kFailed;
    default:
      return SessionState::kStopped;
  }
}

void Session::Finish(const core::Report* report) {
  std::string verdict;
  SessionState state;
  {
    const std::lock_guard lock(mutex_);
    if (report != nullptr && report->termination == core::Termination::kOracleFailed &&
        failure_.reason.empty()) {
      failure_ = ToFailure(report->failure);
    }
    state = FinalState(report);
    final_state_ = state;
    report_ = report != nullptr ? *report : core::Report{};
    end_time_ = std::chrono::system_clock::now();
    final_seconds_ = std::chrono::duration<double>(Clock::now() - created_).count();
    verdict = state == SessionState::kFailed ? failure_.reason + ": " + failure_.message
                                             : report_->certificate.verdict;
  }
  Log(state == SessionState::kFailed ? LogLevel::kWarning : LogLevel::kInfo, log_context(),
      core::Message(SessionStateName(state), " after ", final_seconds_, " s, ", progress_.vertices,
                    " vertices, ", progress_.simplices, " simplices; ", verdict));
  if (options_.observer != nullptr) {
    options_.observer->OnEnd(state, report != nullptr ? *report : core::Report{});
  }
  pool_.Close({blame_});
  WakeWatchers();
  over_ = true;
}

void Session::Cancel() {
  {
    const std::lock_guard lock(mutex_);
    if (final_state_) return;
    cancelled_ = true;
  }
  pool_.Interrupt();
}

bool Session::AddWatcher(std::weak_ptr<SessionWatcher> watcher) {
  const std::lock_guard lock(mutex_);
  std::erase_if(watchers_, [](const auto& w) { return w.expired(); });
  if (watchers_.size() >= options_.max_watchers) return false;
  watchers_.push_back(std::move(watcher));
  return true;
}

void Session::WakeWatchers() {
  std::vector<std::shared_ptr<SessionWatcher>> watchers;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& weak : watchers_) {
      if (auto watcher = weak.lock()) watchers.push_back(std::move(watcher));
    }
  }
  for (const auto& watcher : watchers) watcher->Wake();
}

SessionView Session::View() const {
  SessionView view;
  view.revision = history_.revision();
  view.workers = pool_.workers();
  const std::lock_guard lock(mutex_);
  view.create_time = create_time_;
  view.end_time = end_time_;
  view.progress = progress_;
  view.report = report_;
  view.failure = failure_;
  view.watchers =
      std::count_if(watchers_.begin(), watchers_.end(), [](const auto& w) { return !w.expired(); });
  if (final_state_) {
    view.state = *final_state_;
    view.elapsed_seconds = final_seconds_;
    view.progress.phase = core::Phase::kDone;
    return view;
  }
  view.elapsed_seconds = std::chrono::duration<double>(Clock::now() - created_).count();
  if (view.progress.fraction > 0.02 && view.progress.fraction <= 1) {
    view.remaining_seconds =
        view.elapsed_seconds * (1 - view.progress.fraction) / view.progress.fraction;
  }
  // A cancelled mesh is over for its owner, even while its last round is being computed.
  view.state = cancelled_          ? SessionState::kCancelled
               : view.workers == 0 ? SessionState::kWaiting
                                   : SessionState::kRunning;
  return view;
}

bool Session::HasEnded() const {
  const std::lock_guard lock(mutex_);
  return final_state_.has_value();
}

LogContext Session::log_context() const {
  const std::lock_guard lock(mutex_);
  return {options_.name, progress_.round};
}

}  // namespace stellate::server
