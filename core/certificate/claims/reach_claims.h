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

// That the mesh is fine enough for the reach of M: told by edges, by balls that shrink until M does
// not enter them, and by whatever else was answered; and what follows from a declared reach.
class ReachClaims {
 public:
  // `stars.longest_edge` has moved into the examination.
  ReachClaims(Examination& examination, const StarGeometry& stars);

  // The balls' centres, as long as they may still shrink; balls at vertices, and, of a thorough
  // audit, at closest points of barycentres.
  Eigen::MatrixXd BallQuestions() const { return balls_.Centres(); }
  Eigen::MatrixXd FootQuestions() const;
  void TakeBalls(const AnswerBlock& answer);
  void TakeFeet(const AnswerBlock& answer);

  // A point of a simplex, `number`ed if it is its barycentre, and its closest point y.
  void HoldFoot(const std::uint32_t* ids, double circumradius, double distance,
                const Eigen::VectorXd& y, std::optional<std::uint64_t> number);

  // Points that the balls met are seen then, too.
  void TellWhatBallsMet();
  // The point y of M, seen from vertex v, whose tangent space is right to a sine of `tilt`.
  void HoldPoint(std::uint32_t v, const Eigen::VectorXd& y, double tilt);
  void Hold(const Evidence& evidence);

  void Judge();
  void JudgeDeclared();

 private:
  // Where M was seen narrow: at a vertex, and how far from there the other side is.
  struct Narrow {
    std::uint32_t vertex = 0;
    double across = 0;
  };
  void Take(double reach, Narrow where);
  void HoldDeclared(const StarGeometry& stars);
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
