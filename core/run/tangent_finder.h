#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/batch.h"

namespace stellate::core {

// Finds tangent spaces for oracles that do not give them (Sec. 5.3.1). The derivative of the
// closest-point map at y on M is the projection on T_yM, so that differences of closest points
// along a few directions span it. With a guess (the tangent basis of a nearby sample point) k
// directions are enough, else k + 4 random ones, for any d: 2k closest points a vertex.
//
//   finder.Start(points, guesses);
//   while (const QueryBlock* block = finder.Next()) finder.Absorb(answers to *block);
//   finder.tangents();
class TangentFinder {
 public:
  // step: the length of the differences. most_error: the largest error_length of a point. A point
  // with a larger one is queried once more, along the tangents found.
  TangentFinder(int k, int d, double step, std::uint64_t seed,
                double most_error = std::numeric_limits<double>::infinity());

  // Starts with points y on M, d x n. guesses: one for each point, K rows of d (as Sample::Tangent)
  // or nullptr. shares: of `step` to use for each point, smaller where M is known to bend more, or
  // empty.
  void Start(const Eigen::MatrixXd& points, std::vector<const double*> guesses,
             std::vector<double> shares = {});

  // Returns the closest-point queries still needed, or nullptr once tangents() is complete.
  const QueryBlock* Next() const { return open_.empty() ? nullptr : &block_; }
  void Absorb(const AnswerBlock& answers);

  // (k rows of d) x n, orthonormal. If a point's tangents were not found, its column is zero and ok
  // is 0: some closest point was missing, or M does not look k-dimensional there.
  const Eigen::MatrixXd& tangents() const { return tangents_; }
  const std::vector<std::uint8_t>& ok() const { return ok_; }

  // Bounds the error of all tangents found so far: the sine of the largest angle to the true
  // tangent space is at most this length over the reach. The differences' ends are points of M
  // within 2 step of y, so that none is farther from the tangent space than (2 step)^2 / 2 reach
  // (Federer). The columns of the derivative are therefore wrong by 2 step / reach, and the span of
  // the k directions found by sqrt(m) times that over the least singular value.
  double error_length() const { return error_length_; }

 private:
  void Ask();
  void AskMore();
  double StepAt(Eigen::Index point) const {
    return shares_.empty() ? step_ : shares_[static_cast<std::size_t>(point)] * step_;
  }

  int k_, d_;
  double step_, most_error_;
  double error_length_ = 0;
  std::vector<double> errors_;  // by point, length
  bool again_ = false;          // the open points have tangents already
  std::uint64_t seed_;
  bool guessed_ = false;  // the open queries lie along guesses
  Eigen::MatrixXd points_, tangents_, directions_;
  std::vector<const double*> guesses_;
  std::vector<double> shares_;
  std::vector<std::uint8_t> ok_;
  std::vector<Eigen::Index> open_;  // points whose tangents are not found yet
  QueryBlock block_;
};

}  // namespace stellate::core
