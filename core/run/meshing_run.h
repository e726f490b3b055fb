#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/instantiate.h"
#include "core/base/interruption.h"
#include "core/mesher.h"
#include "core/refinement/engine.h"
#include "core/run/batch_parts.h"
#include "core/run/boundary_detector.h"
#include "core/run/certification.h"
#include "core/run/crease_probe.h"
#include "core/run/crease_watch.h"
#include "core/run/ending.h"
#include "core/run/progress_meter.h"
#include "core/run/query_source.h"
#include "core/run/repeat_check.h"
#include "core/run/round_trip.h"
#include "core/run/spare_points.h"
#include "core/run/tangent_finder.h"
#include "core/run/wall_check.h"
#include "core/run/watches.h"
#include "core/sampling/sampler.h"

namespace stellate::core {

// Runs the engine as the state machine of mesher.h, for one k, from one query source to the next:
// the seeds, each round's candidates and, once no rule is broken, the certificate. Points of M that
// the mesh misses start refinement again. Use it through Mesher::Create.
template <int K>
class MeshingRun final : public Mesher {
 public:
  explicit MeshingRun(Specification spec);

  const QueryBatch* NextBatch() override;
  std::shared_ptr<const QueryBatch> ShareBatch() override;
  Expected<MeshDelta> Absorb(const Answers& answers) override;
  void Interrupt() override { interruption_.Raise(); }
  void Cancel() override { Finish(Termination::kCancelled); }
  void Fail(Status reason) override;

  const Specification& specification() const override { return spec_; }
  const Progress& progress() const override { return progress_; }
  const Report& report() const override { return report_; }
  Eigen::MatrixXd Points() const override;
  Eigen::MatrixXd Tangents() const override { return engine_.stars().sample().TangentMatrix(); }
  std::vector<std::uint32_t> Simplices() const override { return engine_.Simplices(); }

 private:
  // What to do with a round trip's answers.
  using Insertion = void (MeshingRun::*)();

  QueryBatch& OpenBatch();
  Status Check(const QueryBatch& asked, const Answers& answers) const;
  void Count(const QueryBatch& asked);
  void Advance(const Answers& answers);
  void Ask(CandidateSet<K> candidates, Insertion then) {
    Ask(std::move(candidates), then, engine_);
  }
  void Ask(CandidateSet<K> candidates, Insertion then, const Engine<K>& asking);
  void AskFor(Eigen::MatrixXd&& points, Insertion then);
  void NextQuestions();
  void WatchForCreases();
  void AskBeside();
  void TakeBeside(const Answers& answers);

  // What follows when a query source is done.
  void AfterTrip();
  void InsertSeeds();
  void AskForFaces(const Eigen::MatrixXd& seeds);
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
  void Finish(Termination termination);
  void DescribeEnding(bool is_whole);
  void Measure();

  const Specification spec_;
  Engine<K> engine_;
  TangentFinder tangent_finder_;
  Interruption interruption_;
  Progress progress_;
  Report report_;
  MeshDelta delta_;  // of the round being absorbed
  bool over_ = false;

  std::shared_ptr<QueryBatch> batch_;  // of the open round; null: there is none
  std::optional<BatchParts> parts_;    // of batch_, if that is too large for one batch
  std::uint64_t whole_rounds_ = 0;     // rounds; the parts of one count once

  // One of these is the query source.
  std::unique_ptr<RoundTrip<K>> trip_;
  std::unique_ptr<Sampler<K>> sampler_;           // while the initial sample is made
  std::unique_ptr<Sampler<K>> finished_sampler_;  // until refinement is planned on its surrogate
  bool is_sampled_ = false;                       // the initial sample is complete
  std::unique_ptr<Certification> certification_;
  Insertion insertion_ = nullptr;  // of the trip's answers

  // Queries in addition to the source, or alone before the run ends.
  CreaseProbe crease_probe_;
  CreaseWatch crease_watch_;
  WalkedEdges walked_;                      // edges that rounds have probed
  std::optional<std::size_t> probe_block_;  // the probe's block in batch_
  std::optional<Termination> end_;          // how the run ends once the probe is done

  ProgressMeter progress_meter_;
  RepeatCheck repeat_check_;
  WallCheck wall_check_;
  SparePoints spare_points_;
  BoxWatch box_watch_;
  StallWatch stall_watch_;
  BoundaryDetector boundary_detector_;
  bool speculation_failed_ = false;  // the last round of candidates inserted nothing
  bool covers_box_ = false;          // each seed of a covered box has its closest point
  // What the mesh lacked at some time.
  struct {
    std::optional<PieceOfWall> piece;
    std::string inside;  // why no seed's point is in M with boundary, if so
  } lacks_;
};

STELLATE_DECLARE_CLASS(MeshingRun)

}  // namespace stellate::core
