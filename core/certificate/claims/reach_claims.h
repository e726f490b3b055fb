#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>

#include "core/batch.h"
#include "core/certificate/claims/declared_reach.h"
#include "core/certificate/claims/examination.h"
#include "core/certificate/evidence/evidence.h"
#include "core/certificate/evidence/shrinking_balls.h"
#include "core/certificate/measure/star_geometry.h"

namespace stellate::core {

// The claim that the mesh is fine enough for the reach of M. Edges, shrinking balls and all
// answered points bound the reach from above; a declared reach may be proved or refuted by them.
class ReachClaims {
 public:
  // REQUIRES: `stars.longest_edge` has moved into the examination.
  ReachClaims(Examination& examination, const StarGeometry& stars);

  // Return the centres of balls that may still shrink: those at vertices and, in a thorough audit,
  // those at the closest points ("feet") of barycentres.
  Eigen::MatrixXd BallQuestions() const { return balls_.Centres(); }
  Eigen::MatrixXd FootQuestions() const;
  void TakeBalls(const AnswerBlock& answer);
  void TakeFeet(const AnswerBlock& answer);

  // Takes a point of a simplex, its `distance` from M and its closest point y. `number`: of the
  // barycentre, if it is one.
  void TakeFoot(const std::uint32_t* ids, double circumradius, double distance,
                const Eigen::VectorXd& y, std::optional<std::uint64_t> number);

  // Adds the points that the balls met to those seen.
  void TellWhatBallsMet();
  // Takes a point y of M, seen from vertex v, whose tangent space is wrong by an angle of sine
  // `tilt` at most.
  void TakePoint(std::uint32_t v, const Eigen::VectorXd& y, double tilt);
  void TakeEvidence(const Evidence& evidence);

  void Judge();
  void JudgeDeclared();

 private:
  // A narrow place of M: a vertex, and how far from it the other side is.
  struct Narrow {
    std::uint32_t vertex = 0;
    double across = 0;
  };
  void Take(double reach, Narrow where);
  void TestDeclared(const StarGeometry& stars);
  std::string Cure(double ratio) const;
  Eigen::MatrixXd TangentsUnder(const std::uint32_t* ids) const;

  Examination& x_;
  ShrinkingBalls balls_;
  std::optional<ShrinkingBalls> feet_;
  std::optional<DeclaredReach> declared_;
  std::uint32_t edge_p_, edge_q_;  // of the edge that bounds the reach most
  double reach_;                   // at most
  Narrow narrowest_;
  double coarseness_ = 0;
};

}  // namespace stellate::core
