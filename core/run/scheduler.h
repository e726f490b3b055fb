#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/peers.h"
#include "core/query_source.h"
#include "core/refinement/engine.h"
#include "core/run/boundary_detector.h"
#include "core/run/crease_search.h"
#include "core/run/current_source.h"
#include "core/run/ending.h"
#include "core/run/initial_sample.h"
#include "core/run/progress_meter.h"
#include "core/run/repeat_check.h"
#include "core/run/spare_points.h"
#include "core/run/table_check.h"
#include "core/run/wall_check.h"
#include "core/run/watches.h"

namespace stellate::core {

// How a run ended.
struct Outcome {
  Termination termination = Termination::kConverged;
  Status failure;  // of the oracle
  Certificate certificate;
};

struct RunEnd {
  std::optional<Termination> pending{};  // how the run ends once the crease search is done
  std::optional<Outcome> outcome{};
};

// What answers have to agree with, in addition to CheckAnswers.
struct AnswerChecks {
  RepeatCheck repeat;
  WallCheck walls;
  TableCheck table;
};

// What a run has noticed so far.
struct Noticed {
  BoxWatch box;
  StallWatch stall;
  BoundaryDetector boundary;
  bool speculation_failed = false;     // the last round of candidates inserted nothing
  bool covers_box = false;             // each seed of a covered box has its closest point
  std::optional<PieceOfWall> piece{};  // that the mesh lacked at some time
  std::string inside{};                // why no seed's point is in M with boundary, if so
};

// What a run has done so far, and an estimate of what is left.
struct RunCounts {
  std::uint64_t answered = 0;  // rounds, each with all its parts
  Counts counts{};             // without those of the mesh itself
  ProgressMeter meter;
};

// Decides what a run asks next, around its engine: the seeds, each round's candidates and, once no
// rule is broken, the certificate. Points of M that the mesh misses start refinement again.
//
//   Scheduler<K> scheduler(spec, interruption);
//   while (!(questions = scheduler.Questions()).empty()) scheduler.Absorb(their answers);
//   scheduler.outcome();
template <int K>
class Scheduler final : public QuerySource {
 public:
  // All are borrowed.
  Scheduler(const Specification& spec, const Interruption& interruption, const Peers& peers);

  // Whether `answers`, to the open queries, agree with those to the same queries in an earlier
  // round. If not, they must not be absorbed.
  Status Judge(const Answers& answers) const { return checks_.repeat.Judge(answers); }

  std::vector<QueryBlock> Questions() override;
  void Absorb(const std::vector<AnswerBlock>& answers) override;
  bool asks_for_tangents() const override { return source_.asks_for_tangents(); }

  // End the run now.
  void Finish(Termination termination, Status failure = Status::Ok());
  void Fail(Status reason);
  // Takes back an end that an interruption left half done.
  void Reopen() { end_.outcome.reset(); }
  // Nothing until the run is over.
  const std::optional<Outcome>& outcome() const { return end_.outcome; }

  const Engine<K>& engine() const { return engine_; }
  // Returns the simplices that were added and removed since the last call.
  typename Engine<K>::Change TakeChange() { return std::exchange(change_, {}); }
  // Counts a round, or a part of one, of so many queries.
  void CountQueries(std::uint64_t count);
  const Counts& counts() const { return counts_.counts; }  // without those of the mesh itself
  // As ProgressMeter::Measure.
  void Measure(Progress* progress);

 private:
  void Ask(CandidateSet<K> candidates, Purpose purpose) {
    source_.Ask(engine_, std::move(candidates), purpose);
  }
  void AskFor(Eigen::MatrixXd&& points, Purpose purpose);

  // What follows when a query source is done.
  void AfterTrip();
  void TakeTrip();
  void InsertSeeds();
  void AskForSeeds(const Eigen::MatrixXd& seeds);
  void KeepFaceSeeds();
  void JudgeWalls();
  bool PlanFaces(std::optional<std::vector<Target<K>>>* targets);
  bool AskForInterior();
  void SettleCrowds();
  void LeaveFaces();
  void CommitSample();
  void AddAnswered();
  bool AskForSample();
  void InsertCandidates();
  void InsertSpares();
  void Plan();
  void Certify();
  void AfterCertificate();
  bool AskForSpares(const std::vector<double>& points);
  bool AskForSparesOnWalls(const PointsOnWalls& points);
  void End(Termination termination);
  void DescribeEnding();

  const Specification& spec_;
  const Interruption& interruption_;
  Engine<K> engine_;
  CurrentSource<K> source_;
  InitialSample<K> sample_;
  CreaseSearch<K> creases_;  // queries in addition to the source, or alone before the run ends
  SparePoints spare_points_;
  AnswerChecks checks_;
  Noticed noticed_;
  RunCounts counts_;
  typename Engine<K>::Change change_;  // since TakeChange
  RunEnd end_;
};

STELLATE_DECLARE_CLASS(Scheduler)

}  // namespace stellate::core
