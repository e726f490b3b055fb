#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/batch.h"
#include "core/specification.h"
#include "server/oracles/cross_check.h"

namespace stellate::server {

// Whether workers have the same side of each wall inside, over a whole mesh.
//
// Where the points of two answers agree, the signs of their clearances must. But on the wall itself
// a sign is rounding, and a wall's values have no unit: so what counts is whether the two are
// farther apart than the values change, from end to end of M, along what the points may be apart.
// That is not known at the first query; what looks like a contradiction waits until it is.
class WallSigns {
 public:
  explicit WallSigns(const core::Specification& spec);

  // Answers that count, and passed CheckAnswers.
  void Learn(const core::AnswerBlock& answer);
  // Two answers to query `query` of `block` that FindDisagreement has nothing against.
  void Compare(const core::QueryBlock& block, Eigen::Index query, const Testimony& a,
               const Testimony& b);
  // What the workers disagree about, as FindDisagreement says it; empty: nothing that is certain.
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
