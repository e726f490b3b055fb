#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/batch.h"
#include "core/refinement/candidate_set.h"

namespace stellate::core {

// Asks for the closest points of a few answered points once more: a closest-point map leaves points
// of M where they are, and their sizes as they were told.
class RepeatCheck {
 public:
  explicit RepeatCheck(double epsilon) : epsilon_(epsilon) {}

  // Keeps the first of the answers that were found, to be asked for again.
  void Sample(const AnsweredPoints& answers);
  bool has_questions() const { return points_.cols() > 0; }
  QueryBlock Questions() const;

  // kOracleNotIdempotent or kOracleBadSize, naming query and block, the last of `answers`; or Ok.
  Status Judge(const Answers& answers) const;
  void Forget() { points_.resize(0, 0); }

 private:
  double epsilon_;
  Eigen::MatrixXd points_;  // d x m
  Eigen::VectorXd sizes_;   // m, as told first; or empty
};

}  // namespace stellate::core
