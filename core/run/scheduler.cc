#include "core/run/scheduler.h"

#include <algorithm>
#include <utility>

#include "core/certificate/findings.h"
#include "core/refinement/face_seeds.h"
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
Scheduler<K>::Scheduler(const Specification& spec, const Interruption& interruption,
                        const Peers& peers)
    : spec_(spec),
      interruption_(interruption),
      engine_(spec_, Resolve(spec_), peers),
      source_(spec_.oracle,
              {K, spec_.ambient_dimension, kTangentStep * engine_.criteria().epsilon,
               spec_.random_seed, kTangentError * spec_.declared_reach.value_or(INFINITY)}),
      creases_(spec_),
      spare_points_(spec_.ambient_dimension),
      checks_{RepeatCheck(spec_.epsilon), {K, spec_.ambient_dimension, spec_.epsilon}, {}},
      noticed_{.box = {spec_.bounding_box, engine_.criteria().epsilon},
               .stall = StallWatch(K),
               .boundary = {engine_.boundary().policy(), engine_.criteria()}},
      counts_{.meter = ProgressMeter(spec_)} {
  AskForSeeds(SeedsOf(spec_));
}

template <int K>
std::vector<QueryBlock> Scheduler<K>::Questions() {
  while (!end_.outcome) {
    std::vector<QueryBlock> blocks;
    if (!end_.pending) blocks = source_.Questions();
    const bool probes =
        creases_.is_asking() && (end_.pending || (source_.trip() && !blocks.empty()));
    if (probes) creases_.Ask(&blocks);
    if (!blocks.empty()) {
      if (checks_.repeat.has_questions()) blocks.push_back(checks_.repeat.Questions());
      return blocks;
    }
    if (end_.pending)
      Finish(*end_.pending);
    else if (source_.trip())
      AfterTrip();
    else
      AfterCertificate();
  }
  return {};
}

template <int K>
void Scheduler<K>::Absorb(const std::vector<AnswerBlock>& answers) {
  ++counts_.answered;
  checks_.repeat.Forget();
  if (!end_.pending) source_.Absorb(answers);
  creases_.Absorb(answers);
  if (creases_.crease()) Finish(end_.pending.value_or(Termination::kNoProgress));
}

template <int K>
void Scheduler<K>::CountQueries(std::uint64_t count) {
  Counts& counts = counts_.counts;
  ++counts.rounds;
  (asks_for_tangents() ? counts.tangent_queries : counts.queries) += count;
}

template <int K>
void Scheduler<K>::Measure(Progress* progress) {
  counts_.meter.Measure<K>(engine_, source_.certifier() != nullptr, sample_.CountMissing(),
                           progress);
}

template <int K>
void Scheduler<K>::AskFor(Eigen::MatrixXd&& points, Purpose purpose) {
  CandidateSet<K> candidates;
  candidates.planned.points = std::move(points);
  Ask(std::move(candidates), purpose);
}

template <int K>
void Scheduler<K>::AfterTrip() {
  const auto* const answered = source_.trip();
  if (Status status = checks_.table.Judge(source_.trip()->answers(), K); !status.ok())
    return Fail(std::move(status));
  spare_points_.KeepClearances(source_.trip()->answers(), ClearPointsKept(engine_.stars().size()));
  TakeTrip();
  if (end_.outcome || source_.trip() != answered || AskForSample()) return;  // it has more queries
  change_ = engine_.Commit();
  Plan();
}

template <int K>
void Scheduler<K>::TakeTrip() {
  switch (source_.purpose()) {
    case Purpose::kSeeds:
      return InsertSeeds();
    case Purpose::kFaceSeeds:
      return KeepFaceSeeds();
    case Purpose::kWallCheck:
      return JudgeWalls();
    case Purpose::kSample:
      return AddAnswered();
    case Purpose::kCandidates:
      return InsertCandidates();
    case Purpose::kSpares:
      return InsertSpares();
    case Purpose::kCrowds:
      return SettleCrowds();
  }
}

template <int K>
void Scheduler<K>::InsertCandidates() {
  const Inserted inserted = engine_.Insert(source_.trip()->candidates(), source_.trip()->answers());
  const auto count = [&](Rule rule) {
    return static_cast<std::uint64_t>(
        std::count(inserted.rules.begin(), inserted.rules.end(), rule));
  };
  Counts& counts = counts_.counts;
  counts.inserted_size += count(Rule::kSize);
  counts.inserted_radius_edge += count(Rule::kRadiusEdge);
  counts.inserted_sliver += count(Rule::kShape);
  counts.inserted_inconsistent += count(Rule::kInconsistent);
  counts.inserted_protection += count(Rule::kProtection);
  counts.duplicates += inserted.duplicates;
  if (inserted.front_moved) {
    noticed_.stall.NoteFrontMoved();
    creases_.NoteFrontMoved();
  }
  noticed_.boundary.Look(source_.trip()->candidates(), source_.trip()->asked(),
                         source_.trip()->answers());
  noticed_.speculation_failed = inserted.rules.empty();
  spare_points_.Keep(source_.trip()->answers(), inserted.used);
}

template <int K>
void Scheduler<K>::InsertSpares() {
  const AnsweredPoints& answers = source_.trip()->answers();
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
void Scheduler<K>::Plan() {
  const std::unique_ptr<Sampler<K>> finished = sample_.TakeFinished();
  noticed_.box.Look(engine_.stars().sample().points().data(), engine_.stars().size());
  if (engine_.is_full()) return End(Termination::kVertexBudget);
  if (noticed_.box.has_left()) return Finish(Termination::kNoProgress);
  auto targets = engine_.Plan();
  if (!targets) return LeaveFaces();
  if (!PlanFaces(&targets)) return;
  BoundaryState<K>& boundary = engine_.boundary();
  if (targets->empty() && !boundary.has_discoveries())
    return engine_.AllRulesHold() ? Certify() : End(Termination::kNoProgress);
  const ViolationIndex<K>& violations = engine_.violations();
  const bool is_lost =
      noticed_.stall.ShouldLookForLostCauses() && HasPieceTooSmall<K>(engine_, spec_.epsilon);
  if (is_lost ||
      noticed_.stall.IsHopeless(violations.size_and_shape().size(), engine_.stars().size()) ||
      noticed_.stall.HasStalled(violations.size_and_shape().size() + violations.violating(),
                                !violations.are_all_dirty(), boundary.is_last_stage()))
    return LeaveFaces();
  creases_.Watch(engine_);
  *targets = engine_.Select(*targets);
  PlannedPoints planned;
  if (boundary.has_discoveries())
    planned = FaceSeeds<K>(engine_.parts()).TakeDiscoveries();
  else if (engine_.criteria().speculative && !noticed_.speculation_failed &&
           boundary.stage() == K) {
    // The few violations of R1 and R2 that are left are not worth testing R3 and R4 on all stars.
    const bool is_rest = sample_.is_done() && !finished && violations.are_all_dirty();
    planned = RunSpeculatively<K>(engine_, counts_.answered, &*targets,
                                  is_rest ? SpeculativeRules::kSizes : SpeculativeRules::kAllRules,
                                  finished ? finished->guess() : nullptr);
  }
  CandidateSet<K> candidates = engine_.Draw(std::move(*targets), counts_.answered);
  candidates.planned = std::move(planned);
  Ask(std::move(candidates), Purpose::kCandidates);
}

template <int K>
void Scheduler<K>::Certify() {
  if (!engine_.boundary().policy().LeavesInside() &&
      AskForSpares(spare_points_.Uncovered(engine_.stars())))
    return;
  const Stars<K>& stars = engine_.stars();
  if (stars.size() == 0 && !noticed_.inside.empty())  // the discoveries led nowhere
    return Fail({StatusCode::kNoSeeds, noticed_.inside});
  if (!engine_.filled().resolved().empty())
    engine_.filled().HandOut(stars, &change_.added, &change_.removed);
  StarFacts facts = FactsOf<K>(engine_);
  facts.covers_box = noticed_.covers_box;
  if (!spec_.oracle.tangent_basis) facts.tangent_error_length = source_.finder().error_length();
  MeshView mesh;
  mesh.k = K;
  mesh.d = stars.sample().d();
  mesh.vertices = stars.size();
  mesh.points = stars.sample().points().data();
  mesh.tangents = stars.sample().Tangent(0);
  source_.Close();
  creases_.Stop();
  KnownOfManifold known = spare_points_.Take();
  known.tangential_offsets = noticed_.boundary.offsets();
  source_.Certify(std::make_unique<Certification>(spec_, mesh, engine_.Simplices(), facts,
                                                  std::move(known), BoundaryOf<K>(engine_)));
}

template <int K>
void Scheduler<K>::AfterCertificate() {
  if (engine_.filled().is_handed_out() ||
      source_.certifier()->certificate().epsilon_over_reach > kCoarse ||
      !(AskForSparesOnWalls(source_.certifier()->UncoveredOnWalls()) ||
        AskForSpares(source_.certifier()->Uncovered())))
    End(Termination::kConverged);
}

// Returns false if there are none, or if it did not help before.
template <int K>
bool Scheduler<K>::AskForSpares(const std::vector<double>& points) {
  Eigen::MatrixXd chosen =
      spare_points_.Choose(points, engine_.stars(), engine_.criteria().epsilon);
  if (chosen.cols() == 0) return false;
  if (source_.certifier()) spare_points_.GiveBack(source_.certifier()->TakeKnown());
  AskFor(std::move(chosen), Purpose::kSpares);
  return true;
}

STELLATE_INSTANTIATE_CLASS(Scheduler)

}  // namespace stellate::core
