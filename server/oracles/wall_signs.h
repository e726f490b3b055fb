#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/batch.h"
#include "core/specification.h"
#include "server/oracles/cross_check.h"

namespace stellate::server {

// Detects workers that disagree about which side of a wall is inside M. Give it every answer that
// counts (Learn) and every pair of answers to one query (Compare), then ask for the Verdict.
//
// Where the points of two answers agree, the signs of their clearances must agree too, except on
// the wall, where a sign is rounding. A wall's values have no unit, so two values contradict each
// other if they differ by more than the values change, on average over M, along the distance that
// the points may have. The first queries do not show how much that is: a contradiction waits until
// it is known.
class WallSigns {
 public:
  explicit WallSigns(const core::Specification& spec);

  // REQUIRES: the answers count, and passed CheckAnswers.
  void Learn(const core::AnswerBlock& answer);
  // Compares two answers to query `query` of `block`. REQUIRES: FindDisagreement returned "".
  void Compare(const core::QueryBlock& block, Eigen::Index query, const AnswerRef& a,
               const AnswerRef& b);
  // Returns a certain disagreement as a sentence, as of DescribeDisagreement, or "".
  std::string Verdict() const;

 private:
  struct Wall {
    double lowest = 0, highest = 0;  // values seen
    double apart = 0;                // of the worst contradiction
    std::string words;               // about that
  };

  const core::Specification spec_;
  std::vector<Wall> walls_;
  Eigen::VectorXd low_, high_;  // corners of a box around the points seen
  Eigen::Index seen_ = 0;
};

}  // namespace stellate::server
