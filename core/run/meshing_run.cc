#include "core/run/meshing_run.h"

#include <algorithm>
#include <string>
#include <utility>

#include "core/base/arenas.h"
#include "core/base/message.h"
#include "core/certificate/findings.h"
#include "core/run/ending.h"
#include "core/sampling/seeding.h"
#include "core/speculation/speculation.h"

namespace stellate::core {
namespace {

// Differences of closest points are taken over this share of epsilon. The error is proportional to
// it over the reach, far below the error that directions may have (0.03).
constexpr double kTangentStep = 0.01;

// With a declared reach: the error that tangents found by differences may have, radians.
constexpr double kTangentError = 0.03;

// Meshes that end take 1.2 to 5 answers a vertex: all are kept. A mesh that does not end has its
// oldest answers dropped.
std::size_t ClearPointsKept(std::size_t vertices) { return 8 * vertices + 16384; }

}  // namespace

template <int K>
MeshingRun<K>::MeshingRun(Specification spec)
    : spec_(std::move(spec)),
      engine_(spec_, Resolve(spec_)),
      tangent_finder_(K, spec_.ambient_dimension, kTangentStep * engine_.criteria().epsilon,
                      spec_.random_seed, kTangentError * spec_.declared_reach.value_or(INFINITY)),
      crease_probe_(K, spec_.ambient_dimension, spec_.epsilon, spec_.oracle.tangent_basis,
                    spec_.walls > 0, spec_.random_seed),
      progress_meter_(spec_),
      repeat_check_(spec_.epsilon),
      wall_check_(K, spec_.ambient_dimension, spec_.epsilon),
      spare_points_(spec_.ambient_dimension),
      box_watch_(spec_.bounding_box, engine_.criteria().epsilon),
      stall_watch_(K) {
  if (spec_.walls > 0)
    AskForFaces(SeedsOf(spec_));
  else
    AskFor(SeedsOf(spec_), &MeshingRun::InsertSeeds);
  NextQuestions();
}

// Returns the batch that the client answers: the round's, or a part of it.
template <int K>
QueryBatch& MeshingRun<K>::OpenBatch() {
  const std::uint64_t most = spec_.limits.max_batch_queries;
  if (most == 0 || static_cast<std::uint64_t>(batch_->size()) <= most) return *batch_;
  if (!parts_) parts_.emplace(spec_, *batch_, most);
  return parts_->part();
}

template <int K>
const QueryBatch* MeshingRun<K>::NextBatch() {
  if (over_ || !batch_) return nullptr;
  QueryBatch& batch = OpenBatch();
  batch.round = progress_.round + 1;
  return &batch;
}

template <int K>
std::shared_ptr<const QueryBatch> MeshingRun<K>::ShareBatch() {
  const QueryBatch* const batch = NextBatch();
  if (batch == nullptr) return nullptr;
  if (batch == batch_.get()) return batch_;
  return std::make_shared<const QueryBatch>(*batch);  // a part: its place is used again
}

template <int K>
Status MeshingRun<K>::Check(const QueryBatch& asked, const Answers& answers) const {
  if (answers.blocks.size() != asked.blocks.size())
    return {StatusCode::kOracleShape,
            Message("got ", answers.blocks.size(), " answer blocks for ", asked.blocks.size(),
                    " query blocks; send one for each")};
  for (std::size_t b = 0; b < answers.blocks.size(); ++b) {
    const QueryBlock& block = asked.blocks[b];
    if (answers.blocks[b].points.cols() != block.size())
      return {StatusCode::kOracleShape,
              Message("block ", b, " has ", answers.blocks[b].points.cols(), " answers for ",
                      block.size(), " queries; send one for each")};
    if (Status s = CheckAnswers(spec_, block, 0, answers.blocks[b]); !s.ok()) return s;
  }
  return Status::Ok();
}

template <int K>
void MeshingRun<K>::Count(const QueryBatch& asked) {
  const auto size = static_cast<std::uint64_t>(asked.size());
  ++progress_.round;
  progress_.queries += size;
  ++report_.counts.rounds;
  const bool for_tangents = trip_ && trip_->asks_for_tangents();
  (for_tangents ? report_.counts.tangent_queries : report_.counts.queries) += size;
}

template <int K>
Expected<MeshDelta> MeshingRun<K>::Absorb(const Answers& answers) {
  if (over_ || !batch_)
    return Refuse(StatusCode::kFailedPrecondition, "Absorb without a batch: the run is over");
  const QueryBatch& asked = OpenBatch();
  if (Status s = Check(asked, answers); !s.ok()) return tl::unexpected<Status>(s);
  const bool complete = !parts_ || parts_->is_last();
  const std::optional<Answers> joined =
      complete && parts_ ? std::optional(parts_->With(answers)) : std::nullopt;
  const Answers& all = joined ? *joined : answers;
  if (complete) {
    if (Status s = repeat_check_.Judge(all); !s.ok()) return tl::unexpected<Status>(s);
    repeat_check_.Forget();
  }

  const Progress progress_before = progress_;
  const Report report_before = report_;
  Count(asked);
  delta_ = {};
  delta_.revision = progress_.round;
  delta_.first_vertex = engine_.stars().size();
  if (complete) {
    parts_.reset();
    batch_.reset();
    ++whole_rounds_;
  }
  const auto advance = [&] {
    if (complete)
      Advance(all);
    else
      parts_->Take(answers);
    if (!over_ && batch_ && progress_.round >= spec_.limits.max_rounds)
      Finish(Termination::kRoundBudget);
    Measure();
  };
  if (!WithThreads(spec_.threads, interruption_, advance)) {
    // The run may just have ended, but no caller has seen that.
    over_ = false;
    progress_ = progress_before;
    report_ = report_before;
    return Refuse(StatusCode::kCancelled, "the computation was interrupted");
  }
  const Stars<K>& stars = engine_.stars();
  delta_.points = Eigen::Map<const Eigen::MatrixXd>(stars.sample().points().data(),
                                                    stars.sample().d(), stars.size())
                      .rightCols(stars.size() - static_cast<Eigen::Index>(delta_.first_vertex));
  if (spec_.walls > 0)
    for (auto v = static_cast<std::uint32_t>(delta_.first_vertex); v < stars.size(); ++v)
      delta_.walls.push_back(stars.sample().walls(v));
  return std::move(delta_);
}

// Goes from the answers to the next batch, or to the end.
template <int K>
void MeshingRun<K>::Advance(const Answers& answers) {
  if (!end_) (trip_ ? static_cast<QuerySource&>(*trip_) : *certification_).Absorb(answers.blocks);
  TakeBeside(answers);
  NextQuestions();
  if (batch_) AskBeside();
}

// Goes from source to source until one has queries, or the run is over.
template <int K>
void MeshingRun<K>::NextQuestions() {
  while (!over_) {
    QuerySource& source = end_    ? static_cast<QuerySource&>(crease_probe_)
                          : trip_ ? static_cast<QuerySource&>(*trip_)
                                  : *certification_;
    if (std::vector<QueryBlock> blocks = source.Questions(); !blocks.empty()) {
      batch_ = std::make_shared<QueryBatch>(QueryBatch{0, std::move(blocks)});
      return;
    }
    if (end_)
      Finish(*end_);
    else if (trip_)
      AfterTrip();
    else
      AfterCertificate();
  }
}

template <int K>
void MeshingRun<K>::Ask(CandidateSet<K> candidates, Insertion then, const Engine<K>& asking) {
  certification_.reset();
  trip_ = std::make_unique<RoundTrip<K>>(asking, spec_.oracle, tangent_finder_,
                                         std::move(candidates), spec_.walls);
  insertion_ = then;
}

template <int K>
void MeshingRun<K>::AskFor(Eigen::MatrixXd&& points, Insertion then) {
  CandidateSet<K> candidates;
  candidates.planned.points = std::move(points);
  Ask(std::move(candidates), then);
}

template <int K>
void MeshingRun<K>::AfterTrip() {
  const auto* const answered = trip_.get();
  spare_points_.KeepClearances(trip_->answers(), ClearPointsKept(engine_.stars().size()));
  (this->*insertion_)();
  if (over_ || trip_.get() != answered || AskForSample()) return;  // it has more queries
  typename Engine<K>::Change change = engine_.Commit();
  delta_.added = std::move(change.added);
  delta_.removed = std::move(change.removed);
  Plan();
}

template <int K>
void MeshingRun<K>::InsertCandidates() {
  const Inserted inserted = engine_.Insert(trip_->candidates(), trip_->answers());
  Counts& counts = report_.counts;
  const auto count = [&](Rule rule) {
    return static_cast<std::uint64_t>(
        std::count(inserted.rules.begin(), inserted.rules.end(), rule));
  };
  counts.inserted_size += count(Rule::kSize);
  counts.inserted_radius_edge += count(Rule::kRadiusEdge);
  counts.inserted_sliver += count(Rule::kShape);
  counts.inserted_inconsistent += count(Rule::kInconsistent);
  counts.duplicates += inserted.duplicates;
  if (inserted.front_moved) {
    stall_watch_.NoteFrontMoved();
    crease_watch_.NoteFrontMoved();
  }
  if (engine_.criteria().flat_alternations == 1 && spec_.walls == 0)
    boundary_detector_.Look(trip_->candidates(), trip_->answers());
  speculation_failed_ = inserted.rules.empty();
  spare_points_.Keep(trip_->answers(), inserted.used);
}

template <int K>
void MeshingRun<K>::InsertSpares() {
  const AnsweredPoints& answers = trip_->answers();
  std::vector<std::uint8_t> used(answers.found.size(), 0);
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (!answers.found[i]) continue;
    if (engine_.is_full()) break;
    if (answers.Beyond(static_cast<Eigen::Index>(i))) continue;
    engine_.Append(answers, static_cast<Eigen::Index>(i));
    used[i] = 1;
  }
  engine_.MarkAllDirty();
  spare_points_.Keep(answers, used);
}

// Decides what to do next and queries for it, or ends the refinement.
template <int K>
void MeshingRun<K>::Plan() {
  const std::unique_ptr<Sampler<K>> finished = std::move(finished_sampler_);
  box_watch_.Look(engine_.stars().sample().points().data(), engine_.stars().size());
  if (engine_.is_full()) return Finish(Termination::kVertexBudget);
  if (box_watch_.has_left()) return Finish(Termination::kNoProgress);
  auto targets = engine_.Plan();
  if (!targets) return LeaveFaces();
  if (spec_.walls > 0 && !PlanFaces(&targets)) return;
  BoundaryState<K>& boundary = engine_.boundary();
  if (targets->empty() && !boundary.has_discoveries())
    return engine_.AllRulesHold() ? Certify() : End(Termination::kNoProgress);
  const ViolationIndex<K>& violations = engine_.violations();
  const bool is_lost = stall_watch_.ShouldLookForLostCauses() && spec_.walls > 0 &&
                       HasPieceTooSmall<K>(engine_, spec_.epsilon);
  if (is_lost ||
      stall_watch_.IsHopeless(violations.size_and_shape().size(), engine_.stars().size()) ||
      stall_watch_.HasStalled(violations.size_and_shape().size() + violations.violating(),
                              !violations.are_all_dirty()))
    return LeaveFaces();
  WatchForCreases();
  *targets = engine_.Select(*targets);
  PlannedPoints planned;
  if (boundary.has_discoveries())
    planned = engine_.TakeDiscoveries();
  else if (engine_.criteria().speculative && !speculation_failed_ && boundary.stage() == K) {
    // The few violations of R1 and R2 that are left are not worth testing R3 and R4 on all stars.
    const bool is_rest = is_sampled_ && !finished && violations.are_all_dirty();
    planned = RunSpeculatively<K>(engine_, whole_rounds_, &*targets,
                                  is_rest ? SpeculativeRules::kSizes : SpeculativeRules::kAllRules,
                                  finished ? finished->guess() : nullptr);
  }
  CandidateSet<K> candidates = engine_.Draw(std::move(*targets), whole_rounds_);
  candidates.planned = std::move(planned);
  Ask(std::move(candidates), &MeshingRun::InsertCandidates);
}

template <int K>
void MeshingRun<K>::Certify() {
  if (AskForSpares(spare_points_.Uncovered(engine_.stars()))) return;
  const Stars<K>& stars = engine_.stars();
  if (stars.size() == 0 && !lacks_.inside.empty())  // the discoveries led nowhere
    return Fail({StatusCode::kNoSeeds, lacks_.inside});
  if (!engine_.filled().resolved().empty())
    engine_.filled().HandOut(stars, &delta_.added, &delta_.removed);
  StarFacts facts = FactsOf<K>(engine_);
  facts.covers_box = covers_box_;
  if (!spec_.oracle.tangent_basis) facts.tangent_error_length = tangent_finder_.error_length();
  MeshView mesh;
  mesh.k = K;
  mesh.d = stars.sample().d();
  mesh.vertices = stars.size();
  mesh.points = stars.sample().points().data();
  mesh.tangents = stars.sample().Tangent(0);
  trip_.reset();
  crease_probe_.Stop();
  walked_.clear();  // some were not probed to their end
  KnownOfManifold known = spare_points_.Take();
  known.tangential_offsets = boundary_detector_.offsets();
  certification_ = std::make_unique<Certification>(
      spec_, mesh, engine_.Simplices(), facts, std::move(known),
      spec_.walls > 0 ? std::optional(BoundaryOf<K>(engine_)) : std::nullopt);
}

template <int K>
void MeshingRun<K>::AfterCertificate() {
  if (engine_.filled().is_handed_out() ||
      certification_->certificate().epsilon_over_reach > kCoarse ||
      !(AskForSparesOnWalls(certification_->UncoveredOnWalls()) ||
        AskForSpares(certification_->Uncovered())))
    End(Termination::kConverged);
}

// Returns false if there are none, or if it did not help before.
template <int K>
bool MeshingRun<K>::AskForSpares(const std::vector<double>& points) {
  Eigen::MatrixXd chosen =
      spare_points_.Choose(points, engine_.stars(), engine_.criteria().epsilon);
  if (chosen.cols() == 0) return false;
  if (certification_) spare_points_.GiveBack(certification_->TakeKnown());
  AskFor(std::move(chosen), &MeshingRun::InsertSpares);
  return true;
}

template <int K>
void MeshingRun<K>::Fail(Status reason) {
  if (!over_) report_.failure = std::move(reason);
  Finish(Termination::kOracleFailed);
}

template <int K>
void MeshingRun<K>::Finish(Termination termination) {
  if (over_) return;
  over_ = true;
  // The initial sample has no stars yet.
  if (sampler_ && termination == Termination::kRoundBudget) CommitSample();
  // The round was absorbed, so that its delta reports the simplices added here.
  if (termination != Termination::kCancelled && termination != Termination::kOracleFailed)
    engine_.CompleteStars(&delta_.added, &delta_.removed);
  sampler_.reset();
  finished_sampler_.reset();
  batch_.reset();
  parts_.reset();
  report_.termination = termination;
  // An interrupted round leaves a mesh that was never reported.
  const bool is_whole = !interruption_.raised();
  report_.counts.vertices = is_whole ? engine_.stars().size() : progress_.vertices;
  report_.counts.simplices = is_whole ? engine_.simplex_count() : progress_.simplices;
  DescribeEnding(is_whole);
  certification_.reset();
  if (is_whole)
    Measure();
  else
    progress_.phase = Phase::kDone;
}

template <int K>
void MeshingRun<K>::Measure() {
  if (!over_)
    return progress_meter_.Measure<K>(engine_, certification_ != nullptr,
                                      sampler_ ? sampler_->CountMissing() : 0, &progress_);
  progress_.is_foreseeable = false;
  progress_.phase = Phase::kDone;
  progress_.vertices = engine_.stars().size();
  progress_.simplices = engine_.simplex_count();
  progress_.bad_sliver = engine_.violations().slivers();
  progress_.bad_inconsistent = engine_.violations().inconsistent();
  if (report_.termination == Termination::kConverged) progress_.fraction = 1;
}

template <int K>
Eigen::MatrixXd MeshingRun<K>::Points() const {
  const Stars<K>& stars = engine_.stars();
  return Eigen::Map<const Eigen::MatrixXd>(stars.sample().points().data(), stars.sample().d(),
                                           stars.size());
}

STELLATE_INSTANTIATE_CLASS(MeshingRun)

}  // namespace stellate::core
