#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/examination/probe.h"
#include "core/examination/task.h"
#include "core/examination/wall_laws.h"
#include "core/examination/words.h"
#include "core/examiner.h"

namespace stellate::core::examination {

// The laws of an oracle, one after another, as one task that waits for answers.
class Laws final : public Examiner {
 public:
  Laws(Specification spec, std::optional<double> epsilon);

  std::shared_ptr<const QueryBatch> NextBatch() override;
  Status Absorb(const Answers& answers, double seconds) override;
  void Fail(const OracleFault& fault) override;
  const ExaminationReport& report() const override { return report_; }

 private:
  using Matrix = Eigen::MatrixXd;
  using Vector = Eigen::VectorXd;

  // Takes over what the task did; sorts the findings once it is over.
  void Settle();
  void Conclude();
  // The first finding of each kind is kept.
  void Add(Finding finding);
  void Add(const std::string& code, std::initializer_list<Value> values) {
    Add(MakeFinding(code, values));
  }
  bool Has(const std::string& code) const;

  Task<> ObeyAll();
  Task<> ObeyNearby();
  // Fills the probe's starts and points.
  Task<> PointsAreFound();
  void JudgeBox();
  // Of closest points.
  Task<> AnswersRepeat();
  Task<> AnswersStay();
  void NoneSeenIsNearer(const Matrix& x, const Matrix& y, const char* code);
  Task<> NearPointsComeBack();
  void JudgeAngles(const Matrix& x, const Matrix& y, const std::vector<Basis>& tangents);
  // Of dimension, tangents and smoothness.
  Task<> TangentsAreFound();
  void JudgeRanks(double share);
  Task<> TangentsAreRight();
  Task<> SizesAreLengths();
  Task<> ReachIsEstimated();
  Task<> SurfaceIsSmooth();
  // Of flats.
  Task<> FlatsAreMet();
  Task<> Meet(Matrix centers, std::vector<Basis> bases);
  Vector JudgeMet(const Matrix& centers, const std::vector<Basis>& bases, const Vector& radii,
                  const Answered& met, const Answered& again);
  void JudgeRadii(const Matrix& centers, const Vector& radii, const Answered& met);
  Task<> PiecesAreCounted();
  Task<> SpeedIsMeasured();
  void JudgeSpeed();

  // A length within which M should look like its tangent spaces.
  double Near() const;
  // Where two points count as the same.
  double Slack() const;

  const std::optional<double> epsilon_;
  Probe probe_;
  std::optional<WallLaws> walls_;
  ExaminationReport report_;
  Task<> task_;  // after all that it uses
  std::shared_ptr<const QueryBatch> batch_;
  std::uint64_t round_ = 0;
  bool is_over_ = false;
};

}  // namespace stellate::core::examination
