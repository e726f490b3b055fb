#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "core/query_source.h"
#include "core/run/tangent_fits.h"

namespace stellate::core {

// Finds tangent spaces for oracles that do not give them (Sec. 5.3.1).
//
// In codimension 1 the answer y to a query x tells: x - y is normal to M there. Otherwise, the
// derivative of the closest-point map at y is the projection on T_yM, so that differences of
// closest points along a few directions span it. With a guess (the tangent basis of a nearby sample
// point) k directions are enough, else k + 4 random ones, for any d: 2k closest points a vertex.
//
//   finder.Start({points, guesses, {}, asked});
//   // ... drive it as a QuerySource, then:
//   finder.tangents();
//
// Normals are read only after differences have agreed with them, and never again once one has not:
// closest points of an oracle that is not exact, and those on a crease or where M ends, do not lie
// straight below what was asked.
class TangentFinder final : public QuerySource {
 public:
  // step: the length of the differences. most_error: the largest error_length of a point. A point
  // with a larger one is queried once more, along the tangents found.
  TangentFinder(int k, int d, double step, std::uint64_t seed,
                double most_error = std::numeric_limits<double>::infinity());

  struct Points {
    Eigen::MatrixXd points;  // on M, d x n
    // One for each point, K rows of d (as Sample::Tangent) or nullptr.
    std::vector<const double*> guesses;
    // Of `step` to use for each point, smaller where M is known to bend more; or empty.
    std::vector<double> shares{};
    // The queries with these closest points, d x n; a point itself where there was none; or empty.
    Eigen::MatrixXd asked{};
    bool may_leave_out = false;  // the sample can do without some of them
  };
  void Start(Points points);
  // Whether queries should be asked beside M rather than on it: their answers then tell the tangent
  // spaces, too.
  bool reads_normals() const { return (d_ == k_ + 1 || estimates()) && !has_disagreed_; }

  // Improves the tangent bases of points that were found, (K rows of d) x n, once there are others
  // all around.
  void Refine(const Eigen::MatrixXd& points, Eigen::MatrixXd* tangents);

  // One block of closest points.
  std::vector<QueryBlock> Questions() override;
  void Absorb(const std::vector<AnswerBlock>& answers) override;
  bool asks_for_tangents() const override { return true; }
  bool is_done() const { return open_.empty(); }  // tangents() is complete

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
  void StartEstimates();
  void Begin(std::vector<Eigen::Index> open);
  void Ask();
  void AskMore();
  bool CanRead(Eigen::Index point) const;
  void Read(const std::vector<Eigen::Index>& points);
  void Compare();
  void GoOn();
  double StepAt(Eigen::Index point) const {
    return of_.shares.empty() ? step_ : of_.shares[static_cast<std::size_t>(point)] * step_;
  }
  // From its query to a point.
  double Length(Eigen::Index point) const {
    return (of_.asked.col(point) - of_.points.col(point)).norm();
  }
  bool trusts_normals() const;
  bool estimates() const { return d_ > k_ + 1 && !std::isfinite(most_error_); }
  bool Estimate(Eigen::Index point);
  void Remember();

  int k_, d_;
  double step_, most_error_;
  double error_length_ = 0;
  std::uint64_t seed_;
  std::unique_ptr<TangentFits> fits_;
  // Comparisons of normals with differences.
  std::uint64_t agreed_ = 0;
  bool has_disagreed_ = false;

  Points of_;
  Eigen::MatrixXd tangents_, directions_;
  std::vector<std::uint8_t> ok_;
  std::vector<double> errors_;         // by point, length
  std::vector<Eigen::Index> batch_;    // points whose differences are taken now
  std::vector<Eigen::Index> open_;     // those that queries are open for
  std::vector<Eigen::Index> waiting_;  // for the comparison of some normals
  bool again_ = false;                 // the open points have tangents already
  bool guessed_ = false;               // the open queries lie along guesses
  QueryBlock block_;
};

}  // namespace stellate::core
