#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/batch.h"
#include "core/refinement/candidate_set.h"

namespace stellate::core {

// Queries the closest points of a few answers again: a closest-point map must leave points of M
// where they are, with the same sizes. No QuerySource: its block joins a round that is not its own,
// and it can refuse the answers before that round takes them.
//
//   check.Sample(answers);                                  // of the first round
//   batch.blocks.push_back(check.Questions());              // in a later one, as the last block
//   if (Status status = check.Judge(answers); !status.ok()) ...
class RepeatCheck {
 public:
  explicit RepeatCheck(double epsilon) : epsilon_(epsilon) {}

  // Keeps the first answers that were found, to be queried again.
  void Sample(const AnsweredPoints& answers);
  bool has_questions() const { return points_.cols() > 0; }
  QueryBlock Questions() const;

  // Judges the last block of `answers`. Returns kOracleNotIdempotent or kOracleBadSize, with query
  // and block, or Ok.
  Status Judge(const Answers& answers) const;
  void Forget() { points_.resize(0, 0); }

 private:
  double epsilon_;
  Eigen::MatrixXd points_;  // d x m
  Eigen::VectorXd sizes_;   // m, as first answered; or empty
};

}  // namespace stellate::core
