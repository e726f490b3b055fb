#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "doctor/findings.h"
#include "doctor/probe.h"
#include "doctor/walls.h"
#include "shared/doctor.h"
#include "stellate/doctor.h"

namespace stellate::doctor {

// The laws of an oracle, one after another; what breaks one is added to the report.
class Examination {
 public:
  Examination(Oracle& oracle, const CheckOptions& options)
      : options_(options), probe_(oracle, options.random_seed) {}

  CheckReport Run();

 private:
  void ObeyLaws();
  // The first finding of each kind is kept.
  void Add(Finding finding);
  void Add(const std::string& code, std::initializer_list<Value> values) {
    Add(MakeFinding(code, values));
  }
  bool Has(const std::string& code) const { return report_.Find(code) != nullptr; }

  // Of closest points.
  void AnswersRepeat();
  void AnswersStay();
  void AnswersAreClosest();
  void NoneSeenIsNearer(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y, const char* code);
  void NearPointsComeBack();
  void EquationsHaveRank();
  // Of dimension, tangents and smoothness.
  void DimensionIsRight();
  void FewRanksAreWrong() { JudgeRanks(kFewWrongRanks); }
  void JudgeRanks(double share);
  void TangentsAreRight();
  void SizesAreLengths();
  void WallsAreRight();
  void EstimateReach();
  void IsSmooth();
  // Of flats.
  void FlatsAreMet();
  void Meet(const Eigen::MatrixXd& centers, const std::vector<Basis>& bases);
  void RadiiAreKept(const Eigen::MatrixXd& centers, const std::vector<Basis>& bases,
                    const Eigen::VectorXd& distances);
  void CountPieces();
  void MeasureSpeed();

  // A length within which M should look like its tangent spaces.
  double Near() const;
  // Where two points count as the same.
  double Slack() const { return kSlack * probe_.size; }

  const CheckOptions options_;
  Probe probe_;
  std::optional<WallProbe> walls_;
  CheckReport report_;
};

}  // namespace stellate::doctor
