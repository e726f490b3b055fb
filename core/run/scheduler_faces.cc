// What a run of a manifold with boundary does in addition: it queries seeds of its faces.

#include <bit>
#include <string>
#include <utility>
#include <vector>

#include "core/base/message.h"
#include "core/base/parallel.h"
#include "core/refinement/corners.h"
#include "core/refinement/face_seeds.h"
#include "core/run/ending.h"
#include "core/run/scheduler.h"
#include "core/sampling/seeding.h"

namespace stellate::core {
namespace {

// In epsilon: a piece of a wall with a vertex so near, and yet no simplex there, is too small.
constexpr double kKnownWithin = 0.1;

}  // namespace

// Queries the seeds' closest points on M, and on each wall.
template <int K>
void Scheduler<K>::AskForSeeds(const Eigen::MatrixXd& seeds) {
  const BoundaryPolicy& policy = engine_.boundary().policy();
  CandidateSet<K> candidates;
  PlannedPoints& planned = candidates.planned;
  planned.points = seeds.replicate(1, policy.QueriesOfSeed());
  planned.walls = policy.FacesOfSeeds(static_cast<std::size_t>(seeds.cols()));
  Ask(std::move(candidates), policy.MeshesFacesFirst() ? Purpose::kFaceSeeds : Purpose::kSeeds);
}

template <int K>
void Scheduler<K>::KeepFaceSeeds() {
  const AnsweredPoints& answers = source_.trip()->answers();
  std::uint64_t inside = 0;
  for (Eigen::Index c = 0; c < answers.points.cols(); ++c) {
    const auto i = static_cast<std::size_t>(c);
    CheckInterruption(i);
    if (!answers.found[i]) continue;
    engine_.boundary().NoteClearances(answers, c);
    if (const std::optional<int> beyond = answers.Beyond(c)) {
      if (answers.walls[i] != 0)
        engine_.boundary().Discover(answers.points.col(c), answers.walls[i], *beyond);
      continue;
    }
    ++inside;
    if (const std::optional<int> next = answers.NextWall(c); next && answers.walls[i] != 0)
      engine_.boundary().Discover(answers.points.col(c), answers.walls[i], *next);
    // Not all seeds are used, and one may be the only point known of a piece of its wall.
    spare_points_.KeepEnd(answers, c);
    engine_.boundary().KeepSeed(answers.points.col(c), answers.walls[i], answers.tangents.col(c));
  }
  if (inside == 0) noticed_.inside = WhyNothingInside(spec_, answers);
  if (inside == 0 && !engine_.boundary().has_discoveries())
    return Fail({StatusCode::kNoSeeds, noticed_.inside});
  Eigen::MatrixXd steps = checks_.walls.Questions(answers);
  if (steps.cols() > 0) AskFor(std::move(steps), Purpose::kWallCheck);
}

template <int K>
void Scheduler<K>::JudgeWalls() {
  if (Status status = checks_.walls.Judge(source_.trip()->answers()); !status.ok())
    Fail(std::move(status));
}

// Queries points of walls where the mesh should end, but does not: faces are meshed from there.
// Returns false as AskForSpares does.
template <int K>
bool Scheduler<K>::AskForSparesOnWalls(const PointsOnWalls& points) {
  const Stars<K>& stars = engine_.stars();
  const double epsilon = engine_.criteria().epsilon;
  PointsOnWalls news;
  for (std::size_t i = 0; i < points.walls.size(); ++i) {
    CheckInterruption(i);
    const double* y = points.points.data() + i * static_cast<std::size_t>(stars.sample().d());
    bool is_news = true;
    stars.sample().ForEachWithin(y, kKnownWithin * epsilon, [&](std::uint32_t p) {
      is_news = is_news && !IsSubset(points.walls[i], stars.sample().walls(p));
    });
    if (!is_news) continue;
    news.points.insert(news.points.end(), y, y + stars.sample().d());
    news.walls.push_back(points.walls[i]);
  }
  CandidateSet<K> candidates;
  candidates.planned = spare_points_.ChooseOnWalls(news, epsilon);
  if (candidates.planned.size() == 0) return false;
  noticed_.piece = {std::countr_zero(candidates.planned.walls.front()),
                    candidates.planned.points.col(0)};
  spare_points_.GiveBack(source_.certifier()->TakeKnown());
  Ask(std::move(candidates), Purpose::kSpares);
  return true;
}

// Samples the interior, if there is any, once its faces are meshed. Returns whether there are
// queries for it; else all stars are whole.
template <int K>
bool Scheduler<K>::AskForInterior() {
  if (engine_.stars().size() == 0) return false;
  AnsweredPoints seeds = FaceSeeds<K>(engine_.parts()).OfInterior();
  std::vector<std::uint8_t> used;
  sample_.Begin(engine_, spec_, seeds, &used);
  if (AskForSample()) return true;
  CommitSample();
  return false;
}

// Continues with seeds of the stage, or with the next stage, if nothing is left to do on faces up
// to the stage. Returns false if there are queries for them, or the run is over.
template <int K>
bool Scheduler<K>::PlanFaces(std::optional<std::vector<Target<K>>>* targets) {
  const BoundaryState<K>& boundary = engine_.boundary();
  if (!boundary.crowds().empty()) {
    CandidateSet<K> candidates;
    candidates.planned = Corners<K>(engine_.parts()).Questions();
    Ask(std::move(candidates), Purpose::kCrowds);
    return false;
  }
  while (true) {
    const bool idle = (*targets)->empty() && !boundary.has_discoveries();
    if (PlannedPoints seeds = idle ? FaceSeeds<K>(engine_.parts()).Choose() : PlannedPoints();
        seeds.size() > 0) {
      CandidateSet<K> candidates;
      candidates.planned = std::move(seeds);
      Ask(std::move(candidates), Purpose::kSpares);
      return false;
    }
    if (engine_.NeedsProtectingBalls(**targets)) {
      *targets = engine_.ProtectSharpEdges(&change_.added, &change_.removed);
    } else {
      if (!idle || !engine_.AdvanceStage()) break;
      if (boundary.stage() == K) {
        if (AskForInterior()) return false;
        if (engine_.is_full()) {
          Finish(Termination::kVertexBudget);
          return false;
        }
      }
      *targets = engine_.Plan();
    }
    noticed_.stall.NoteFrontMoved();
    if (!*targets) {
      LeaveFaces();
      return false;
    }
  }
  return true;
}

template <int K>
void Scheduler<K>::SettleCrowds() {
  const std::optional<CrowdedCorner> bad =
      Corners<K>(engine_.parts()).Settle(source_.trip()->answers());
  if (bad) Fail({StatusCode::kOracleBadConormal, WhyTooCrowded(*bad, K)});
}

// Call it when rounds no longer help: leaves the faces of this stage as they are, for the sake of
// the rest; in the last stage the run is over.
template <int K>
void Scheduler<K>::LeaveFaces() {
  if (!engine_.LeaveStage()) return End(Termination::kNoProgress);
  noticed_.stall = StallWatch(1);  // next to them not all can be fixed: with less patience
  if (engine_.boundary().stage() == K && AskForInterior()) return;
  Plan();
}

#define STELLATE_EACH(K)                                                 \
  template void Scheduler<K>::AskForSeeds(const Eigen::MatrixXd&);       \
  template void Scheduler<K>::KeepFaceSeeds();                           \
  template void Scheduler<K>::JudgeWalls();                              \
  template bool Scheduler<K>::AskForSparesOnWalls(const PointsOnWalls&); \
  template bool Scheduler<K>::AskForInterior();                          \
  template void Scheduler<K>::SettleCrowds();                            \
  template void Scheduler<K>::LeaveFaces();                              \
  template bool Scheduler<K>::PlanFaces(std::optional<std::vector<Target<K>>>*);
STELLATE_INSTANTIATE_FUNCTIONS(STELLATE_EACH)
#undef STELLATE_EACH

}  // namespace stellate::core
