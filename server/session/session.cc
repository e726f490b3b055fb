#include "server/session/session.h"

#include <malloc.h>

#include <algorithm>
#include <exception>
#include <new>
#include <utility>

#include "core/base/message.h"

namespace stellate::server {
namespace {

using core::StatusCode;

// So that the time since then is how long servers have had the mesh, earlier ones included.
TimePoint CreatedAt(const std::optional<SessionRecord>& record) {
  constexpr double kLongest = 1e9;  // what only a forged record exceeds must not overflow the clock
  const double had = record ? record->last.elapsed_seconds : 0;
  const std::chrono::duration<double> before(had > 0 ? std::min(had, kLongest) : 0);
  return Clock::now() - std::chrono::duration_cast<Clock::duration>(before);
}

double Seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

// Fields that tell a mesh from others, where its name says nothing.
LogFields WhatItIs(const MeshRequest& request) {
  return LogFields().Add("owner", request.owner).Add("label", request.label);
}

LogFields EndFields(const MeshRequest& request, const SessionEnd& end, bool suspended,
                    const core::Report& report, const core::Progress& progress) {
  LogFields fields = WhatItIs(request);
  fields.Add("state", suspended ? "SUSPENDED" : SessionStateName(end.state))
      .Add("certified", report.certificate.certified)
      .Add("seconds", end.elapsed_seconds)
      .Add("vertices", progress.vertices)
      .Add("simplices", progress.simplices)
      .Add("queries", progress.queries);
  if (end.state == SessionState::kFailed) {
    fields.Add("reason", FailureReasonName(end.failure.reason)).Add("failure", end.failure.message);
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

Session::Session(SessionOptions options, MesherFactory factory)
    : options_(std::move(options)),
      factory_(std::move(factory)),
      pool_(request().spec, DispatchOptions{request().timeouts, policy().dispatch},
            policy().max_workers, ports().observer),
      create_time_(options_.record ? options_.record->create_time
                                   : std::chrono::system_clock::now()),
      created_(CreatedAt(options_.record)),
      replaying_(options_.record.has_value()) {
  if (ports().journal != nullptr) {
    pool_.TellOfAnswers([journal = ports().journal.get()](const auto& round, std::size_t block,
                                                          auto first, auto count) {
      journal->TakeAnswers(round, block, first, count);
    });
  }
  if (!options_.record || !options_.record->result) {
    history_ =
        std::make_shared<WatchLog>(request().spec.dimension, request().spec.ambient_dimension);
    return;
  }
  const SessionEnd& end = *options_.record->end;
  const SessionResult& result = *options_.record->result;
  replaying_ = false;
  final_state_ = end.state;
  end_time_ = end.time;
  final_seconds_ = end.elapsed_seconds;
  failure_ = end.failure;
  progress_ = result.progress;
  past_ = result.past;
  report_ = result.report;
  revision_ = result.revision;
  history_bytes_ = result.history_bytes;
  result_is_recorded_ = true;
  pool_.Shut();
  CountHistory();
  over_ = true;
}

void Session::Run() {
  std::unique_ptr<core::Mesher> mesher;
  std::optional<core::Report> report;
  try {
    auto made = factory_(request().spec);
    if (made) {
      mesher = std::move(*made);
      SetInterruptible(mesher.get());
      RunRounds(mesher.get());
      report = mesher->report();
    } else {
      Fail(nullptr, ToMeshFailure(made.error()), made.error());
    }
  } catch (const std::bad_alloc&) {
    Fail(nullptr,
         {FailureReason::kLimitExceeded,
          "the server ran out of memory for this mesh: ask for a larger epsilon "
          "or fewer vertices"},
         core::Status::Ok());
  } catch (const std::exception& error) {
    Fail(nullptr,
         {FailureReason::kInternal, core::Message("a fault of the server: ", error.what())},
         core::Status::Ok());
  }
  SetInterruptible(nullptr);
  Finish(report ? &*report : nullptr);
  mesher.reset();  // it is large, and watchers, who have heard the end, do not need it
  // The allocator would keep the memory of each mesh's own thread. A server that stops has it back
  // sooner by leaving.
  if (!stopping_) malloc_trim(0);
  RecordResult();
  CountHistory();
  over_ = true;
  EndReplay();
}

// What Cancel may interrupt in the middle of a round.
void Session::SetInterruptible(core::Mesher* mesher) {
  const std::lock_guard lock(mutex_);
  computing_ = mesher;
}

void Session::RunRounds(core::Mesher* mesher) {
  Log(LogLevel::kInfo, log_context(), replaying_ ? "replaying" : "meshing",
      WhatItIs(request())
          .Add("dimension", request().spec.dimension)
          .Add("ambient_dimension", request().spec.ambient_dimension)
          .Add("epsilon", request().spec.epsilon));
  if (ports().journal != nullptr && !options_.record) {
    if (auto failure = ports().journal->WriteStart(request(), create_time_)) {
      FailBlameless(mesher, std::move(*failure));
    }
  }
  while (true) {
    if (abandoned_ || (cancelled_ && !replaying_)) mesher->Cancel();
    const core::QueryBatch* const batch = mesher->NextBatch();
    if (batch == nullptr) {
      if (auto failure = PublishRound(mesher)) FailBlameless(mesher, std::move(*failure));
      return;
    }
    if (!FitsMemory(mesher, static_cast<std::uint64_t>(batch->size()))) continue;
    replaying_ ? ReplayRound(mesher, *batch) : RunRound(mesher, mesher->ShareBatch());
  }
}

std::uint64_t Session::ReplayBytes() const {
  return EstimateMeshBytes(request().spec, options_.record ? options_.record->last.vertices : 0, 0);
}

// False, and the mesh has failed, if it has grown beyond what the server can hold.
bool Session::FitsMemory(core::Mesher* mesher, std::uint64_t queries) {
  if (ports().memory == nullptr) return true;
  const std::uint64_t bytes =
      EstimateMeshBytes(request().spec, mesher->progress().vertices, queries);
  if (replaying_) {
    ports().memory->SetUnchecked(std::max(bytes, ReplayBytes()));  // its own, all the while
    return true;
  }
  auto refused = ports().memory->Set(bytes);
  if (refused) FailBlameless(mesher, ToMeshFailure(*refused));
  return !refused;
}

// Where there is nothing to replay any more, only says so: the mesh goes on from this batch, unless
// it was cancelled meanwhile.
void Session::ReplayRound(core::Mesher* mesher, const core::QueryBatch& batch) {
  if (batch.round > options_.record->rounds) {
    EndReplay();
    if (options_.record->end) return RepeatEnd(mesher);
    Log(LogLevel::kInfo, {request().name, batch.round, request().owner},
        "replayed; going on with new answers");
    return;
  }
  SessionJournal::Known known = ports().journal->BeginRound(batch);
  if (!known.failure) known.failure = PublishRound(mesher);
  if (known.failure) {
    FailBlameless(mesher, std::move(*known.failure));
  } else {
    Absorb(mesher, *known.answers);
  }
}

void Session::EndReplay() {
  if (replaying_.exchange(false) && ports().on_replayed) ports().on_replayed();
}

// The recorded answers are used up, and the mesh ended here.
void Session::RepeatEnd(core::Mesher* mesher) {
  const SessionEnd& end = *options_.record->end;
  if (end.state == SessionState::kFailed) return FailBlameless(mesher, end.failure);
  if (end.state == SessionState::kCancelled) {
    cancelled_ = true;
    return mesher->Cancel();
  }
  FailBlameless(mesher, {FailureReason::kReplayMismatch,
                         "the recorded answers made a whole mesh once, and now do not: this "
                         "server meshes differently from the one that recorded them; mesh anew"});
}

// While the workers are at this round's queries, watchers are shown what the last one led to.
void Session::RunRound(core::Mesher* mesher, const std::shared_ptr<const core::QueryBatch>& batch) {
  SessionJournal::Known known;
  if (ports().journal != nullptr) known = ports().journal->BeginRound(*batch);
  if (known.failure) return FailBlameless(mesher, std::move(*known.failure));
  OraclePool::Outcome outcome = pool_.Ask(
      batch,
      [&] {
        if (auto failure = PublishRound(mesher)) pool_.Fail(std::move(*failure));
      },
      known.parts);
  if (outcome.failure) {
    // The worker at fault has been told on its own stream; the others are blameless.
    FailBlameless(mesher, std::move(*outcome.failure));
    return;
  }
  if (!outcome.round) return;  // interrupted: the caller cancels
  const core::Answers& answers = outcome.round->answers;
  if (ports().journal != nullptr) {
    const Standing standing{mesher->progress().vertices, Seconds(Clock::now() - created_)};
    if (auto failure = ports().journal->WriteRound(*batch, answers, standing)) {
      FailBlameless(mesher, std::move(*failure));
      return;
    }
  }
  const auto queries = static_cast<std::size_t>(batch->size());
  if (!Absorb(mesher, answers)) return;
  if (ports().observer != nullptr) ports().observer->OnRound(queries);
  if (LogEnabled(LogLevel::kDebug)) {
    Log(LogLevel::kDebug, {request().name, batch->round, request().owner}, "round answered",
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
      Fail(mesher, ToMeshFailure(delta.error()), delta.error());
    return false;
  }
  unseen_ = std::move(*delta);
  return true;
}

// How the mesh stands, and what has changed since it was last shown.
std::optional<MeshFailure> Session::PublishRound(core::Mesher* mesher) {
  if (unseen_) {
    const std::uint64_t revision = unseen_->revision;
    const core::Status logged = history_->Append(*unseen_);  // it is there until the end
    unseen_.reset();
    if (!logged.ok()) {
      return MeshFailure{FailureReason::kInternal,
                         core::Message("a fault of the server: ", logged.message)};
    }
    const std::lock_guard lock(mutex_);
    past_.Add({revision, mesher->progress(), replaying_ ? 0 : Seconds(Clock::now() - created_)});
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
  if (failure_.reason != FailureReason::kNone) return SessionState::kFailed;
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
        failure_.reason == FailureReason::kNone) {
      failure_ = ToMeshFailure(report->failure);
    }
    end = {FinalState(report), std::max(std::chrono::system_clock::now(), create_time_),
           Seconds(Clock::now() - created_), failure_, progress_.round};
    suspended = suspended_ && end.state == SessionState::kCancelled;
    ending_ = true;
  }
  const bool ended_before = options_.record && options_.record->end.has_value();
  if (ended_before && end.state == options_.record->end->state) end = *options_.record->end;
  // Before anyone hears of it, so that nobody finds it running later.
  if (ports().journal != nullptr && !suspended && !ended_before) {
    const auto failure = ports().journal->WriteEnd(end);
    end_is_recorded_ = !failure;
    if (failure) {
      Log(LogLevel::kWarning, log_context(),
          core::Message("the end of the mesh is not recorded: ", failure->message));
    }
  }
  // A replay that got there, and not one that failed on its way.
  if (ended_before) end_is_recorded_ = !abandoned_ && progress_.round == end.rounds;
  // Counted before it can be seen, as whoever sees the end may look at the metrics next.
  if (ports().observer != nullptr && !suspended && !ended_before) {
    ports().observer->OnEnd(end.state, report != nullptr ? *report : core::Report{});
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
    fields = EndFields(request(), end, suspended, *report_, progress_);
  }
  Log(end.state == SessionState::kFailed ? LogLevel::kWarning : LogLevel::kInfo, log_context(),
      suspended ? "mesh suspended until the server is back" : "mesh ended", fields);
  pool_.Close({blame_});
  WakeWatchers();
}

// The mesh itself, in the place of the answers that led to it. Until then, or if the disk has no
// room for it, the next server replays these once more.
void Session::RecordResult() {
  if (!end_is_recorded_) return;
  const SessionResult result{progress_, *report_, history_->revision(), history_->MemoryBytes(),
                             past_};
  if (const auto failure = ports().journal->WriteResult(result, *history_)) {
    Log(LogLevel::kWarning, log_context(),
        core::Message("the next server will have to replay the mesh: ", failure->message));
    return;
  }
  const std::lock_guard lock(mutex_);
  revision_ = result.revision;
  history_bytes_ = result.history_bytes;
  result_is_recorded_ = true;
  history_used_ = Clock::now();
}

}  // namespace stellate::server
