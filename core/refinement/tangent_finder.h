#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/batch.h"

namespace stellate::core {

// Tangent spaces for clients that cannot give them (Sec. 5.3.1): the derivative of the closest-point
// map at y on M is the projection on T_yM, so differences of closest points along a few directions
// span it. With a guess (the tangent basis of a nearby sample point) k directions do, else k + 4
// random ones, whatever d is: 2k closest points a vertex.
class TangentFinder {
 public:
  // step: how far from M to look, length.
  TangentFinder(int k, int d, double step, std::uint64_t seed);

  // Points y on M, d x n; guesses one a point: K rows of d (as StarComplex::Tangent) or nullptr;
  // shares of `step` to look at, one a point, or empty: where M is known to bend more than
  // elsewhere.
  void Start(const Eigen::MatrixXd& points, std::vector<const double*> guesses,
             std::vector<double> shares = {});

  // The closest-point queries still needed, or nullptr when Result() is complete.
  const QueryBlock* Next() const { return open_.empty() ? nullptr : &block_; }
  void Absorb(const AnswerBlock& answers);

  // (k rows of d) x n, orthonormal. A column of a point where none was found is zero, and ok is 0:
  // some closest point was missing, or M does not look k-dimensional there.
  const Eigen::MatrixXd& tangents() const { return tangents_; }
  const std::vector<std::uint8_t>& ok() const { return ok_; }

 private:
  void Ask();
  double StepAt(Eigen::Index point) const {
    return shares_.empty() ? step_ : shares_[static_cast<std::size_t>(point)] * step_;
  }

  int k_, d_;
  double step_;
  std::uint64_t seed_;
  bool guessed_ = false;  // the open questions lie along guesses
  Eigen::MatrixXd points_, tangents_, directions_;
  std::vector<const double*> guesses_;
  std::vector<double> shares_;
  std::vector<std::uint8_t> ok_;
  std::vector<Eigen::Index> open_;  // points whose tangents are asked for
  QueryBlock block_;
};

}  // namespace stellate::core
