#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/examination.h"
#include "core/certificate/claims/reach_claims.h"
#include "core/certificate/claims/tangent_check.h"
#include "core/certificate/evidence/undeclared_boundary_check.h"

namespace stellate::core {

// The claim that the mesh lies on M: its vertices do and, nearly, points inside its simplices; the
// oracle's tangent spaces are M's; and M does not end there. Bounds of the reach that the closest
// points give go to `reach`, those with a tangential offset to `boundary_check`.
class ClosenessClaims {
 public:
  ClosenessClaims(Examination& examination, ReachClaims& reach,
                  UndeclaredBoundaryCheck& boundary_check);

  Eigen::MatrixXd InsideQuestions() const;
  Eigen::MatrixXd VertexQuestions() const;
  Eigen::MatrixXd TangentQuestions();  // empty if the oracle gives no tangents, or all is decided
  Eigen::MatrixXd BoundaryQuestions() { return boundary_check_.Questions(x_.position_error); }

  // Sets the examination's position_error, from answers to VertexQuestions and InsideQuestions.
  // Call it before all other judgements.
  void JudgeVertices(const AnswerBlock& answer, const AnswerBlock& inside);
  void JudgeInside(const Eigen::MatrixXd& asked, const AnswerBlock& answer);
  void JudgeTangents(const AnswerBlock& answer);
  void JudgeBends();  // once there are no more TangentQuestions
  void JudgeBoundary(const AnswerBlock& answer);
  void JudgeDeviation();
  const std::vector<std::uint32_t>& simplices() const { return simplices_; }
  std::uint32_t points_inside() const { return points_inside_; }
  std::uint64_t points_compared() const { return points_inside_ * simplices_.size(); }

 private:
  Eigen::VectorXd AlongSimplex(const std::uint32_t* ids, const Eigen::VectorXd& step) const;

  Examination& x_;
  ReachClaims& reach_;
  UndeclaredBoundaryCheck& boundary_check_;
  std::vector<std::uint32_t> simplices_, vertices_;  // that are asked about
  std::uint32_t points_inside_ = 1;                  // of each simplex
  std::optional<TangentCheck> tangents_;
  std::vector<double> deviating_;  // closest to barycentres farther away than max_deviation, d each
};

}  // namespace stellate::core
