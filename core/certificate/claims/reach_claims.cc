#include "core/certificate/claims/reach_claims.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "core/base/dense.h"
#include "core/base/message.h"
#include "core/base/random.h"
#include "core/certificate/along.h"
#include "core/certificate/evidence/probes.h"
#include "core/geometry/reach_bound.h"

namespace stellate::core {
namespace {

// Two points of M nearer to each other than this share of the mesh size are on two sides of a thin
// part or gap.
constexpr double kThin = 0.25;
// If no more than this share of the probed places is too coarse, graded sizes are cheaper than a
// smaller epsilon.
constexpr double kFewPlaces = 0.5;
// If the mesh is too coarse by less, a smaller epsilon costs little everywhere.
constexpr double kMuchFiner = 2;

// Whether a point at this distance from a vertex and this distance from its tangent space, both
// squared, may bound the reach by less than `reach`, or is within rounding of that.
bool MayBound(double length2, double away2, double reach) {
  constexpr double kLost = 1e-12, kMargin = 1 - 1e-6;
  return !(4 * reach * reach * (away2 + kLost * length2) < kMargin * length2 * length2);
}

}  // namespace

ReachClaims::ReachClaims(Examination& examination, const StarGeometry& stars)
    : x_(examination),
      balls_(x_.mesh, x_.longest_edge),
      edge_p_(stars.narrowest_p),
      edge_q_(stars.narrowest_q),
      reach_(stars.reach) {
  narrowest_ = {edge_p_, (x_.Vertex(edge_p_) - x_.Vertex(edge_q_)).norm()};
  if (x_.spec.declared_reach) TestDeclared(stars);
  if (x_.thorough()) feet_.emplace(x_.mesh, x_.longest_edge);
  balls_.AddLargest(x_.spec.random_seed, kBallCount);
  const std::uint64_t step =
      x_.thorough() ? 1 : std::max<std::uint64_t>(kBallStride, x_.mesh.vertices / kMaxBallPairs);
  for (std::uint64_t v = 0; v < x_.mesh.vertices; v += step) {
    const auto id = static_cast<std::uint32_t>(v);
    balls_.AddPair(id, kPairRadius * x_.LocalSize(id), x_.spec.random_seed);
  }
}

void ReachClaims::TestDeclared(const StarGeometry& stars) {
  const double reach = *x_.spec.declared_reach;
  declared_.emplace(
      x_.mesh, ReachClaim{reach, std::asin(std::min(1.0, x_.facts.tangent_error_length / reach))},
      x_.spec.oracle.tangent_basis);
  if (x_.certificate.closed && stars.unembedded_stars == 0) declared_->Prove(*x_.stars, x_.shape);
}

Eigen::MatrixXd ReachClaims::FootQuestions() const {
  return feet_ ? feet_->Centres() : Eigen::MatrixXd();
}

void ReachClaims::TakeBalls(const AnswerBlock& answer) {
  balls_.Absorb(answer.points, answer.found, x_.position_error);
}

void ReachClaims::TakeFeet(const AnswerBlock& answer) {
  feet_->Absorb(answer.points, answer.found, x_.position_error);
}

// Returns an orthonormal basis that nearly spans the tangent space of M under a simplex.
Eigen::MatrixXd ReachClaims::TangentsUnder(const std::uint32_t* ids) const {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(x_.mesh.d, x_.mesh.k);
  const auto first = x_.Tangents(ids[0]);
  for (int i = 0; i <= x_.mesh.k; ++i) {
    const auto tangent = x_.Tangents(ids[i]);
    sum += tangent * (tangent.transpose() * first);
  }
  return OrthonormalBasis(sum, x_.mesh.k);
}

void ReachClaims::TakeFoot(const std::uint32_t* ids, double circumradius, double distance,
                           const Eigen::VectorXd& y, std::optional<std::uint64_t> number) {
  if (declared_) declared_->TestDistance(ids, circumradius, distance, x_.position_error);
  if (feet_ && number)
    feet_->AddPair(ids, y, TangentsUnder(ids), kPairRadius * x_.LocalSize(ids[0]),
                   ~(Mix64(x_.spec.random_seed) + *number));
  Eigen::VectorXd step(x_.mesh.d);
  for (int i = 0; i <= x_.mesh.k; ++i) {
    for (int c = 0; c < x_.mesh.d; ++c) step[c] = y[c] - x_.mesh.Point(ids[i])[c];
    const double length2 = Dot(step.data(), step.data(), x_.mesh.d);
    const double away2 = length2 - SquaredAlong(x_.mesh, ids[i], step.data());
    if (!MayBound(length2, away2, reach_)) continue;
    const auto tangent = x_.Tangents(ids[i]);
    const double length = step.norm();
    const double away = (step - tangent * (tangent.transpose() * step)).norm();
    if (IsTelling(length, away, x_.longest_edge[ids[i]], x_.position_error))
      Take(ReachBound(length * length, away), {ids[i], length});
  }
}

void ReachClaims::TakePoint(std::uint32_t v, const Eigen::VectorXd& y, double tilt) {
  const Eigen::VectorXd step = y - x_.Vertex(v);
  const auto tangent = x_.Tangents(v);
  const double length = step.norm();
  const double away =
      (step - tangent * (tangent.transpose() * step)).norm() - tilt * length - x_.position_error;
  if (!(away > 0)) return;
  const double reach = ReachBound(length * length, away);
  coarseness_ = std::max(coarseness_, x_.longest_edge[v] * std::numbers::inv_sqrt3 / reach);
  Take(reach, {v, length});
}

void ReachClaims::TellWhatBallsMet() {
  x_.seen.insert(x_.seen.end(), balls_.met().begin(), balls_.met().end());
  if (feet_) x_.seen.insert(x_.seen.end(), feet_->met().begin(), feet_->met().end());
}

void ReachClaims::TakeEvidence(const Evidence& evidence) {
  coarseness_ = std::max(coarseness_, evidence.coarseness);
  Take(evidence.reach, {evidence.vertex, evidence.distance});
}

void ReachClaims::Take(double reach, Narrow where) {
  if (reach >= reach_) return;
  reach_ = reach;
  narrowest_ = where;
}

// Returns what to do instead of a smaller epsilon.
std::string ReachClaims::Cure(double ratio) const {
  const std::optional<double>& rate = x_.spec.criteria.size_rate;
  if (x_.graded() && rate)
    return Message(", or size_rate at most ", Brief(*rate * kAdvised / ratio));
  // A ball on one side alone finds curvature.
  if (ratio < kMuchFiner * kCoarse || 2 * balls_.coarse_share() >= kFewPlaces) return {};
  return Message(", or, if it bends so sharply in a few places only, size_rate ", kAdvised,
                 ", which makes the mesh finer there alone");
}

void ReachClaims::Judge() {
  for (const ShrinkingBalls* balls : {&balls_, feet_ ? &*feet_ : nullptr}) {
    if (!balls) continue;
    coarseness_ = std::max(coarseness_, balls->coarseness());
    Take(balls->reach(), {balls->narrowest(), balls->distance()});
  }
  x_.certificate.estimated_reach = reach_;
  const double ratio =
      x_.graded() ? std::max(x_.facts.max_size_ratio, coarseness_) : x_.size / reach_;
  x_.certificate.epsilon_over_reach = x_.graded() ? ratio : x_.spec.epsilon / reach_;
  if (ratio <= kCoarse) return;
  x_.findings.Refuse(
      Findings::kReach,
      Message("too coarse to trust: ",
              TooCoarse(ratio, reach_,
                        Message("near vertex ", narrowest_.vertex, " at ",
                                NamePoint(x_.Vertex(narrowest_.vertex)))),
              Cure(ratio),
              narrowest_.across < kThin * x_.size
                  ? Message(". Two points of it there are only ", Brief(narrowest_.across),
                            " apart: if nothing so thin should be there, check the dimension (a "
                            "wall is no surface, a wire no curve)")
                  : std::string()));
}

void ReachClaims::JudgeDeclared() {
  if (!declared_) return;
  const double noise = x_.position_error;
  if (edge_p_ != edge_q_) declared_->TestEdge(edge_p_, edge_q_, noise);
  declared_->TestBall(balls_.narrowest(), balls_.reach(), balls_.distance(), noise);
  // All other evidence: a point of M and a tangent space make a ball, too.
  declared_->TestBall(narrowest_.vertex, reach_, narrowest_.across, noise);
  declared_->Conclude(x_.facts.covers_box, x_.findings, x_.certificate);
}

}  // namespace stellate::core
