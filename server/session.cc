#include "server/session.h"

#include <malloc.h>

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

// When it was created, on the clock that measures how long it takes. The clock on the wall may have
// been set back since.
TimePoint CreatedAt(std::chrono::system_clock::time_point create_time) {
  return Clock::now() - AgeOf(create_time);
}

// Fields that tell a mesh from others, where its name says nothing.
LogFields WhatItIs(const SessionOptions& options) {
  return LogFields().Add("owner", options.owner).Add("label", options.label);
}

LogFields EndFields(const SessionOptions& options, const SessionEnd& end, bool suspended,
                    const core::Report& report, const core::Progress& progress) {
  LogFields fields = WhatItIs(options);
  fields.Add("state", suspended ? "SUSPENDED" : SessionStateName(end.state))
      .Add("certified", report.certificate.certified)
      .Add("seconds", end.elapsed_seconds)
      .Add("vertices", progress.vertices)
      .Add("simplices", progress.simplices)
      .Add("queries", progress.queries);
  if (end.state == SessionState::kFailed) {
    fields.Add("reason", end.failure.reason).Add("failure", end.failure.message);
  } else if (!suspended) {
    fields.Add("verdict", report.certificate.verdict);
  }
  return fields;
}

}  // namespace

Clock::duration AgeOf(std::chrono::system_clock::time_point time) {
  const auto age = std::chrono::system_clock::now() - time;
  return std::max(std::chrono::duration_cast<Clock::duration>(age), Clock::duration::zero());
}

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
      pool_(options_.spec, options_.dispatch, options_.max_workers, options_.observer),
      history_(options_.spec.dimension, options_.spec.ambient_dimension),
      create_time_(options_.record ? options_.record->create_time
                                   : std::chrono::system_clock::now()),
      created_(CreatedAt(create_time_)),
      replaying_(options_.record.has_value()) {}

void Session::Run() {
  std::unique_ptr<core::Mesher> mesher;
  std::optional<core::Report> report;
  try {
    auto made = factory_(options_.spec);
    if (made) {
      mesher = std::move(*made);
      Expose(mesher.get());
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
  Expose(nullptr);
  Finish(report ? &*report : nullptr);
  mesher.reset();  // it is large, and watchers, who have heard the end, do not need it
  // The allocator would keep the memory of each mesh's own thread. A server that stops has it back
  // sooner by leaving.
  if (!stopping_) malloc_trim(0);
  if (options_.memory != nullptr) {
    options_.memory->Insist(EstimateFinishedBytes(options_.spec) + history_.MemoryBytes());
  }
  over_ = true;
}

// What Cancel may interrupt in the middle of a round.
void Session::Expose(core::Mesher* mesher) {
  const std::lock_guard lock(mutex_);
  computing_ = mesher;
}

void Session::RunRounds(core::Mesher* mesher) {
  Log(LogLevel::kInfo, log_context(), replaying_ ? "replaying" : "meshing",
      WhatItIs(options_)
          .Add("dimension", options_.spec.dimension)
          .Add("ambient_dimension", options_.spec.ambient_dimension)
          .Add("epsilon", options_.spec.epsilon));
  if (options_.journal != nullptr && !options_.record) {
    if (auto failure = options_.journal->WriteStart(options_, create_time_)) {
      FailBlameless(mesher, std::move(*failure));
    }
  }
  while (true) {
    if (cancelled_) mesher->Cancel();
    const core::QueryBatch* const batch = mesher->NextBatch();
    if (batch == nullptr) {
      if (auto failure = Show(mesher)) FailBlameless(mesher, std::move(*failure));
      return;
    }
    if (!FitsMemory(mesher, static_cast<std::uint64_t>(batch->size()))) continue;
    if (replaying_ && ReplayRound(mesher, *batch)) continue;
    RunRound(mesher, *batch);
  }
}

// False, and the mesh has failed, if it has grown beyond what the server can hold.
bool Session::FitsMemory(core::Mesher* mesher, std::uint64_t queries) {
  if (options_.memory == nullptr) return true;
  const std::uint64_t bytes =
      EstimateMeshBytes(options_.spec, mesher->progress().vertices, queries);
  if (replaying_) {
    options_.memory->Insist(bytes);
    return true;
  }
  auto refused = options_.memory->Set(bytes);
  if (refused) FailBlameless(mesher, ToFailure(*refused));
  return !refused;
}

// False when there is nothing to replay any more and the mesh goes on.
bool Session::ReplayRound(core::Mesher* mesher, const core::QueryBatch& batch) {
  SessionJournal::Replay replay;
  if (batch.round <= options_.record->rounds) replay = options_.journal->ReadRound(batch);
  if (replay.failure) {
    FailBlameless(mesher, std::move(*replay.failure));
  } else if (replay.answers) {
    if (auto failure = Show(mesher)) {
      FailBlameless(mesher, std::move(*failure));
    } else {
      Absorb(mesher, *replay.answers);
    }
  } else {
    replaying_ = false;
    if (options_.record->end) {
      RepeatEnd(mesher);
    } else {
      Log(LogLevel::kInfo, {options_.name, batch.round, options_.owner},
          "replayed; going on with new answers");
      return false;
    }
  }
  return true;
}

// The recorded answers are used up, and the mesh ended here.
void Session::RepeatEnd(core::Mesher* mesher) {
  const SessionEnd& end = *options_.record->end;
  if (end.state == SessionState::kFailed) return FailBlameless(mesher, end.failure);
  if (end.state == SessionState::kCancelled) {
    cancelled_ = true;
    return mesher->Cancel();
  }
  FailBlameless(mesher, {"REPLAY_MISMATCH",
                         "the recorded answers made a whole mesh once, and now do not: this "
                         "server meshes differently from the one that recorded them; mesh anew"});
}

// While the workers are at this round's queries, watchers are shown what the last one led to.
void Session::RunRound(core::Mesher* mesher, const core::QueryBatch& batch) {
  OraclePool::Outcome outcome = pool_.Ask(batch, [&] {
    if (auto failure = Show(mesher)) pool_.Fail(std::move(*failure));
  });
  if (outcome.failure) {
    // The worker at fault has been told on its own stream; the others are blameless.
    FailBlameless(mesher, std::move(*outcome.failure));
    return;
  }
  if (!outcome.round) return;  // interrupted: the caller cancels
  const core::Answers& answers = outcome.round->answers;
  if (options_.journal != nullptr) {
    if (auto failure = options_.journal->WriteRound(batch, answers)) {
      FailBlameless(mesher, std::move(*failure));
      return;
    }
  }
  const std::uint64_t round = batch.round;  // the batch is gone once it is absorbed
  const auto queries = static_cast<std::size_t>(batch.size());
  if (!Absorb(mesher, answers)) return;
  if (options_.observer != nullptr) options_.observer->OnRound(queries);
  if (LogEnabled(LogLevel::kDebug)) {
    Log(LogLevel::kDebug, {options_.name, round, options_.owner}, "round answered",
        LogFields().Add("queries", queries).Add("vertices", mesher->progress().vertices));
  }
}

bool Session::Absorb(core::Mesher* mesher, const core::Answers& answers) {
  auto delta = mesher->Absorb(answers);
  if (!delta) {
    // What the round would have led to nobody has seen; a suspended mesh goes on from its answers.
    if (delta.error().code == StatusCode::kCancelled)
      mesher->Cancel();
    else
      Fail(mesher, ToFailure(delta.error()), delta.error());
    return false;
  }
  unseen_ = std::move(*delta);
  return true;
}

// How the mesh stands, and what has changed since it was last shown.
std::optional<MeshFailure> Session::Show(core::Mesher* mesher) {
  if (unseen_) {
    const core::Status logged = history_.Append(*unseen_);
    unseen_.reset();
    if (!logged.ok()) {
      return MeshFailure{"INTERNAL", core::Message("a fault of the server: ", logged.message)};
    }
  }
  {
    const std::lock_guard lock(mutex_);
    progress_ = mesher->progress();
  }
  WakeWatchers();
  return {};
}

// The mesh fails, but not by an answer of the workers that serve it now.
void Session::FailBlameless(core::Mesher* mesher, MeshFailure failure) {
  core::Status status{StatusCode::kOracleFailed, failure.message};
  Fail(mesher, std::move(failure), std::move(status));
  blame_ = core::Status::Ok();
}

void Session::Fail(core::Mesher* mesher, MeshFailure failure, core::Status status) {
  {
    const std::lock_guard lock(mutex_);
    failure_ = std::move(failure);
  }
  blame_ = status;
  if (mesher != nullptr) mesher->Fail(std::move(status));
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
  SessionEnd end;
  bool suspended = false;
  {
    const std::lock_guard lock(mutex_);
    if (report != nullptr && report->termination == core::Termination::kOracleFailed &&
        failure_.reason.empty()) {
      failure_ = ToFailure(report->failure);
    }
    end = {FinalState(report), std::max(std::chrono::system_clock::now(), create_time_),
           std::chrono::duration<double>(Clock::now() - created_).count(), failure_,
           progress_.round};
    suspended = suspended_ && end.state == SessionState::kCancelled;
    ending_ = true;
  }
  const bool ended_before = options_.record && options_.record->end.has_value();
  if (ended_before && end.state == options_.record->end->state) end = *options_.record->end;
  // Before anyone hears of it, so that nobody finds it running later.
  if (options_.journal != nullptr && !suspended && !ended_before) {
    if (const auto failure = options_.journal->WriteEnd(end)) {
      Log(LogLevel::kWarning, log_context(),
          core::Message("the end of the mesh is not recorded: ", failure->message));
    }
  }
  // Counted before it can be seen, as whoever sees the end may look at the metrics next.
  if (options_.observer != nullptr && !suspended && !ended_before) {
    options_.observer->OnEnd(end.state, report != nullptr ? *report : core::Report{});
  }
  // Whoever has seen the end finds the door shut.
  pool_.Shut();
  LogFields fields;
  {
    const std::lock_guard lock(mutex_);
    final_state_ = end.state;
    report_ = report != nullptr ? *report : core::Report{};
    end_time_ = end.time;
    final_seconds_ = end.elapsed_seconds;
    fields = EndFields(options_, end, suspended, *report_, progress_);
  }
  Log(end.state == SessionState::kFailed ? LogLevel::kWarning : LogLevel::kInfo, log_context(),
      suspended ? "mesh suspended until the server is back" : "mesh ended", fields);
  pool_.Close({blame_});
  WakeWatchers();
}

void Session::Cancel() {
  {
    const std::lock_guard lock(mutex_);
    if (ending_) return;
    cancelled_ = true;
    if (computing_ != nullptr) computing_->Interrupt();
  }
  pool_.Interrupt();
}

void Session::Suspend() {
  stopping_ = true;
  {
    const std::lock_guard lock(mutex_);
    suspended_ = options_.journal != nullptr && !cancelled_;
  }
  Cancel();
}

std::uint64_t Session::PublishedRevision() const {
  return std::max(history_.revision(), options_.record ? options_.record->rounds : 0);
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
  view.waiting_queries = pool_.waiting();
  if (options_.memory != nullptr) view.bytes = options_.memory->bytes();
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

bool Session::HasVertices() const {
  const std::lock_guard lock(mutex_);
  return progress_.vertices > 0;
}

bool Session::HasEnded() const {
  const std::lock_guard lock(mutex_);
  return final_state_.has_value();
}

LogContext Session::log_context() const {
  const std::lock_guard lock(mutex_);
  return {options_.name, progress_.round, options_.owner};
}

}  // namespace stellate::server
