#include "server/session/session.h"

#include <malloc.h>

#include <algorithm>
#include <exception>
#include <new>
#include <utility>

#include "core/base/arenas.h"
#include "core/base/message.h"
#include "server/points/point_rounds.h"

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
    fields.Add("verdict", VerdictOf(request, report.certificate.verdict));
  }
  return fields;
}

std::uint64_t BytesOf(const MeshRequest& request, std::uint64_t vertices, std::uint64_t queries) {
  return request.points ? EstimateReconstructionBytes(request.points->spec, request.points->points)
                        : EstimateMeshBytes(request.spec, vertices, queries);
}

std::unique_ptr<PointIntake> IntakeOf(const MeshRequest& request) {
  if (!request.points) return nullptr;
  return std::make_unique<PointIntake>(*request.points, request.timeouts.worker_wait);
}

core::Expected<std::unique_ptr<core::Mesher>> Begin(const SessionOptions& options,
                                                    const Session::MesherFactory& factory,
                                                    PointIntake* intake) {
  const core::Execution execution = options.policy.execution;
  if (intake == nullptr) return factory(options.request.spec, execution);
  return std::make_unique<PointRounds>(*options.request.points, execution, &intake->watch(),
                                       &intake->places());
}

const char* KindOf(const SessionOptions& options) {
  if (options.examiner) return "examination";
  return options.request.points ? "reconstruction" : "mesh";
}

// A mesh that has ended before told of itself then.
std::shared_ptr<SpanSink> SinkOf(const SessionOptions& options) {
  return options.record && options.record->end ? nullptr : options.ports.spans;
}

Life FirstLife(const std::optional<SessionRecord>& record) {
  if (!record) return Life::kMeshing;
  if (record->result) return Life::kOver;
  if (!record->end) return Life::kReplaying;
  const bool was_cancelled = record->end->state == SessionState::kCancelled;
  return was_cancelled ? Life::kReplayingCancelled : Life::kRepeating;
}

// Returns what to add to the mesher's refusal of an answer that contradicts another. Workers are
// compared in some of their answers only, so the other may be another worker's; "" if not.
std::string WhoContradicts(const OraclePool& pool, const core::Status& refusal) {
  const bool contradicts = refusal.code == StatusCode::kOracleBadConormal ||
                           refusal.code == StatusCode::kOracleBadSize ||
                           refusal.code == StatusCode::kOracleNotIdempotent;
  return contradicts ? pool.WhoAnswered() : "";
}

}  // namespace

Clock::duration AgeOf(std::chrono::system_clock::time_point time) {
  const auto age = std::chrono::system_clock::now() - time;
  return std::max(std::chrono::duration_cast<Clock::duration>(age), Clock::duration::zero());
}

Session::Session(SessionOptions options, const MesherFactory& factory)
    : options_(std::move(options)),
      factory_(options_.examiner ? options_.examiner : factory),
      spans_(SinkOf(options_), request(), KindOf(options_), options_.record.has_value()),
      pool_(request().spec, DispatchOptions{request().timeouts, policy().dispatch},
            policy().max_workers, ports().observer),
      intake_(IntakeOf(request())),
      history_(options_),
      create_time_(options_.record ? options_.record->create_time
                                   : std::chrono::system_clock::now()),
      created_(CreatedAt(options_.record)),
      life_(FirstLife(options_.record)) {
  if (spans_.IsActive()) pool_.SetFollower(&spans_);
  if (ports().journal != nullptr) {
    pool_.SetOnAnswered([journal = ports().journal.get()](const auto& round, std::size_t block,
                                                          auto first, auto count) {
      journal->TakeAnswers(round, block, first, count);
    });
  }
  if (ports().journal == nullptr || options_.record) ports().recorded->Happen();
  if (life_.now() != Life::kOver) return;
  end_ = options_.record->end;
  report_ = options_.record->result->report;
  progress_ = options_.record->result->progress;
  pool_.Shut();
  if (intake_ != nullptr) intake_->Close({});
}

void Session::Run() {
  std::unique_ptr<core::Mesher> mesher;
  std::optional<core::Report> report;
  try {
    auto made = Begin(options_, factory_, intake_.get());
    if (made) {
      mesher = std::move(*made);
      if (ports().turns) mesher = InTurns(std::move(mesher), ports().turns, request().owner);
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
  Orient();
  const Ending ending = ChooseEnd(report ? &*report : nullptr);
  const bool is_recorded = RecordEnd(ending);
  ShowEnd(ending);
  mesher.reset();  // it is large, and watchers, who have heard the end, do not need it
  // The allocator would keep the memory of each mesh's own thread. A server that stops has it back
  // sooner by leaving.
  if (!ending.server_stops) malloc_trim(0);
  if (is_recorded) RecordResult();
  history_.CountBytes();
  if (ports().on_replayed) ports().on_replayed();
  Step(LifeEvent::kRelease);
}

// What Cancel may interrupt in the middle of a round.
void Session::SetInterruptible(core::Mesher* mesher) {
  const std::lock_guard lock(mutex_);
  computing_ = mesher;
}

void Session::RunRounds(core::Mesher* mesher) {
  LogFields what = WhatItIs(request());
  what.Add("dimension", request().spec.dimension)
      .Add("ambient_dimension", request().spec.ambient_dimension);
  if (request().points) {
    what.Add("points", request().points->points);
  } else {
    what.Add("epsilon", request().spec.epsilon);
  }
  Log(LogLevel::kInfo, log_context(), IsReplaying() ? "replaying" : "meshing", what);
  if (ports().journal != nullptr && !options_.record) {
    if (auto failure = ports().journal->WriteStart(request(), create_time_)) {
      FailBlameless(mesher, std::move(*failure));
    } else {
      ports().recorded->Happen();
    }
  }
  while (true) {
    const Life now = life();  // as it was before NextBatch, all through this pass
    if (MustEnd(now)) mesher->Cancel();
    const TimePoint planned = Clock::now();
    const auto batch = mesher->NextBatch();
    if (batch == nullptr) {
      if (auto failure = PublishRound(mesher)) FailBlameless(mesher, std::move(*failure));
      return;
    }
    const bool is_known = options_.record && batch->round <= options_.record->rounds;
    // Once the points are there, and nobody has seen an end, the rest is no replay but the work.
    const bool is_work =
        intake_ != nullptr && batch->size() == 0 && is_known && !options_.record->end;
    if (is_known && !is_work) {
      ReplayRound(mesher, *batch);
    } else if (server::IsReplaying(now)) {
      EndReplay(mesher, batch->round);
    } else if (FitsMemory(mesher, static_cast<std::uint64_t>(batch->size()))) {
      RunRound(mesher, batch, planned);
    }
  }
}

std::uint64_t Session::ReplayBytes() const {
  return BytesOf(request(), options_.record ? options_.record->last.vertices : 0, 0);
}

void Session::ReplayRound(core::Mesher* mesher, const core::QueryBatch& batch) {
  if (ports().memory != nullptr) {
    const std::uint64_t bytes =
        BytesOf(request(), mesher->progress().vertices, static_cast<std::uint64_t>(batch.size()));
    ports().memory->SetUnchecked(std::max(bytes, ReplayBytes()));  // its own, all the while
  }
  SessionJournal::Known known = ports().journal->BeginRound(batch);
  if (!known.failure) known.failure = PublishRound(mesher);
  if (known.failure) {
    FailBlameless(mesher, std::move(*known.failure));
  } else {
    Absorb(mesher, *known.answers);
  }
}

// The recorded answers are used up. The mesh goes on from this batch, unless it has been cancelled
// or has ended here before.
void Session::EndReplay(core::Mesher* mesher, std::uint64_t next_round) {
  if (options_.record->end) return RepeatEnd(mesher);
  {
    const std::lock_guard lock(mutex_);
    if (!life_.Step(LifeEvent::kReplayed)) return;
  }
  if (ports().on_replayed) ports().on_replayed();
  spans_.Replayed(next_round - 1);
  Log(LogLevel::kInfo, {request().name, next_round, request().owner},
      "replayed; going on with new answers");
}

void Session::RepeatEnd(core::Mesher* mesher) {
  const SessionEnd& end = *options_.record->end;
  if (end.state == SessionState::kFailed) return FailBlameless(mesher, end.failure);
  if (end.state == SessionState::kCancelled) return mesher->Cancel();
  FailBlameless(mesher, {FailureReason::kReplayMismatch,
                         "the recorded answers made a whole mesh once, and now do not: this "
                         "server meshes differently from the one that recorded them; mesh again"});
}

// False, and the mesh has failed, if it has grown beyond what the server can hold.
bool Session::FitsMemory(core::Mesher* mesher, std::uint64_t queries) {
  if (ports().memory == nullptr) return true;
  auto refused = ports().memory->Set(BytesOf(request(), mesher->progress().vertices, queries));
  if (refused) FailBlameless(mesher, ToMeshFailure(*refused));
  return !refused;
}

// While the workers are at this round's queries, watchers are shown what the last one led to.
void Session::RunRound(core::Mesher* mesher, const std::shared_ptr<const core::QueryBatch>& batch,
                       TimePoint planned) {
  const RoundSpan span(&spans_, *batch, planned);
  SessionJournal::Known known;
  if (ports().journal != nullptr) known = ports().journal->BeginRound(*batch);
  if (known.failure) return FailBlameless(mesher, std::move(*known.failure));
  const bool is_recorded = ports().journal == nullptr || known.answers.has_value();
  OraclePool::Outcome outcome = Ask(mesher, batch, std::move(known));
  spans_.Step(intake_ == nullptr ? "ask" : "receive");
  if (outcome.failure) {
    // The worker at fault has been told on its own stream; the others are blameless.
    FailBlameless(mesher, std::move(*outcome.failure));
    return;
  }
  if (!outcome.round) return;  // interrupted: the caller cancels
  const core::Answers& answers = outcome.round->answers;
  if (!is_recorded) {
    const Standing standing{mesher->progress().vertices, Seconds(Clock::now() - created_)};
    if (auto failure = ports().journal->WriteRound(*batch, answers, standing)) {
      FailBlameless(mesher, std::move(*failure));
      return;
    }
    spans_.Step("record");
  }
  const auto queries = static_cast<std::size_t>(batch->size());
  const bool is_absorbed = Absorb(mesher, answers);
  spans_.Step("absorb");
  if (!is_absorbed) return;
  if (ports().observer != nullptr) {
    intake_ == nullptr ? ports().observer->OnRound(queries) : ports().observer->OnPoints(queries);
  }
  if (LogEnabled(LogLevel::kDebug)) {
    Log(LogLevel::kDebug, {request().name, batch->round, request().owner}, "round answered",
        LogFields().Add("queries", queries).Add("vertices", mesher->progress().vertices));
  }
}

OraclePool::Outcome Session::Ask(core::Mesher* mesher,
                                 const std::shared_ptr<const core::QueryBatch>& batch,
                                 SessionJournal::Known known) {
  if (intake_ == nullptr) {
    return pool_.Ask(
        batch,
        [&] {
          if (auto failure = PublishRound(mesher)) pool_.Fail(std::move(*failure));
        },
        known.parts);
  }
  OraclePool::Outcome outcome;
  outcome.failure = PublishRound(mesher);
  if (outcome.failure) return outcome;
  if (!known.answers) {
    PointIntake::Outcome came = intake_->Ask(*batch);
    outcome.failure = std::move(came.failure);
    known.answers = std::move(came.answers);
  }
  if (known.answers) {
    outcome.round = std::make_shared<Round>(Round{batch, std::move(*known.answers), {}});
  }
  return outcome;
}

bool Session::Absorb(core::Mesher* mesher, const core::Answers& answers) {
  if (intake_ != nullptr) intake_->Note(answers);
  auto delta = mesher->Absorb(answers);
  if (!delta) {
    // What the round would have led to nobody has seen; a suspended mesh goes on from its answers.
    if (delta.error().code == StatusCode::kCancelled)
      mesher->Cancel();
    else {
      delta.error().message += WhoContradicts(pool_, delta.error());
      Fail(mesher, ToMeshFailure(delta.error()), delta.error());
    }
    return false;
  }
  unseen_ = std::move(*delta);
  return true;
}

// How the mesh stands, and what has changed since it was last shown.
std::optional<MeshFailure> Session::PublishRound(core::Mesher* mesher) {
  if (unseen_) {
    const double seconds = IsReplaying() ? 0 : Seconds(Clock::now() - created_);
    const core::Status published =
        history_.Publish(*unseen_, {unseen_->revision, mesher->progress(), seconds},
                         intake_ != nullptr ? std::exchange(intake_->places(), {}) : PointPlaces());
    unseen_.reset();
    if (!published.ok()) {
      return MeshFailure{FailureReason::kInternal,
                         core::Message("a fault of the server: ", published.message)};
    }
  }
  {
    const std::lock_guard lock(mutex_);
    progress_ = mesher->progress();
  }
  history_.WakeWatchers();
  return {};
}

// Before the end is seen, so that whoever sees it can have the orientation. The mesh is whole
// without: clients can do with less.
void Session::Orient() {
  if (history_.revision() == 0 || life() == Life::kSuspended) return;
  try {
    core::WithThreads(policy().execution.threads, orienting_, [this] { history_.Orient(); });
  } catch (const std::bad_alloc&) {
    Log(LogLevel::kWarning, log_context(), "no memory to orient the mesh: it ends without");
  }
}

// The mesh fails, but not by an answer of the workers that serve it now.
void Session::FailBlameless(core::Mesher* mesher, MeshFailure failure) {
  core::Status status{StatusCode::kOracleFailed, failure.message};
  Fail(mesher, std::move(failure), std::move(status));
  blame_ = core::Status::Ok();
}

void Session::Fail(core::Mesher* mesher, MeshFailure failure, core::Status status) {
  failure_ = std::move(failure);
  spans_.Fail(failure_.message);
  blame_ = status;
  if (mesher != nullptr) mesher->Fail(std::move(status));
}

SessionState Session::FinalState(const core::Report* report) const {
  if (failure_.reason != FailureReason::kNone) return SessionState::kFailed;
  if (IsSeenAsCancelled(life_.now()) || report == nullptr) return SessionState::kCancelled;
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

Session::Ending Session::ChooseEnd(const core::Report* report) {
  Ending ending;
  if (report != nullptr) ending.report = *report;
  if (ending.report.termination == core::Termination::kOracleFailed &&
      failure_.reason == FailureReason::kNone) {
    const std::string who = WhoContradicts(pool_, ending.report.failure);
    ending.report.failure.message += who;
    ending.report.certificate.verdict += who;
    failure_ = ToMeshFailure(ending.report.failure);
  }
  const auto& record = options_.record;
  const std::lock_guard lock(mutex_);
  SessionEnd& end = ending.end;
  end = {FinalState(report), std::max(std::chrono::system_clock::now(), create_time_),
         Seconds(Clock::now() - created_), failure_, progress_.round};
  ending.is_elsewhere = IsElsewhere(*this);
  ending.server_stops = life_.now() == Life::kSuspended;
  // Also where the journal was waited for, and the wait was broken off.
  ending.is_suspended =
      ending.is_elsewhere || (ending.server_stops && ports().journal != nullptr &&
                              (end.state == SessionState::kCancelled ||
                               end.failure.reason == FailureReason::kJournalFailed));
  const bool ended_before = record && record->end;
  // Cancelled, and its replay broken off: the next server repeats all that watchers have seen.
  if (record && end.state == SessionState::kCancelled) {
    end.rounds = std::max(end.rounds, record->rounds);
  }
  if (ended_before && record->end->state == end.state) end = *record->end;
  const bool is_broken_off = ended_before && MustEnd(life_.now());
  ending.is_whole = end.rounds == progress_.round && !is_broken_off &&
                    (!ended_before || record->end->state == end.state);
  life_.Step(LifeEvent::kEnd);
  return ending;
}

// Before the end can be seen, so that the mesh is not found running later. True: the journal has
// the end of the mesh as it is, and may be given its result.
bool Session::RecordEnd(const Ending& ending) {
  if (options_.record && options_.record->end) return ending.is_whole;
  if (ending.is_suspended) return false;
  std::optional<MeshFailure> failure;
  if (ports().journal != nullptr) failure = ports().journal->WriteEnd(ending.end);
  if (failure) {
    Log(LogLevel::kWarning, log_context(),
        core::Message("the end of the mesh is not recorded: ", failure->message));
  }
  // Counted before it can be seen, as the client that sees the end may look at the metrics next.
  if (ports().observer != nullptr) ports().observer->OnEnd(ending.end.state, ending.report);
  return ports().journal != nullptr && !failure && ending.is_whole;
}

void Session::ShowEnd(const Ending& ending) {
  pool_.Shut();  // first: a worker that has seen the end finds the door shut
  LogFields fields;
  {
    const std::lock_guard lock(mutex_);
    end_ = ending.end;
    report_ = ending.report;
    fields = EndFields(request(), ending.end, ending.is_suspended, ending.report, progress_);
    life_.Step(LifeEvent::kShow);
  }
  Log(ending.end.state == SessionState::kFailed ? LogLevel::kWarning : LogLevel::kInfo,
      log_context(),
      ending.is_elsewhere   ? "mesh goes on in another server"
      : ending.is_suspended ? "mesh suspended until the server is back"
                            : "mesh ended",
      fields);
  pool_.Close({blame_});
  // Of a mesh that goes on elsewhere, or later, this is no end: the next server tells of that.
  spans_.End({ending.is_elsewhere || ending.is_suspended ? "SUSPENDED"
                                                         : SessionStateName(ending.end.state),
              ending.is_suspended ? MeshFailure() : ending.end.failure, ending.report, progress_});
  if (intake_ != nullptr) intake_->Close(blame_);
  history_.WakeWatchers();
  ports().recorded->Happen();  // also of a mesh that failed before it was recorded
}

// The mesh itself, in the place of the answers that led to it. Until then, or if the disk has no
// room for it, the next server replays these once more.
void Session::RecordResult() {
  if (const auto failure = history_.Record(progress_, *report_)) {
    Log(LogLevel::kWarning, log_context(),
        core::Message("the next server will have to replay the mesh: ", failure->message));
  }
}

}  // namespace stellate::server
