#include "core/certificate/claims/declared_reach.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/infinity.h"
#include "core/base/message.h"
#include "core/base/vector_ops.h"
#include "core/certificate/point_of.h"
#include "core/geometry/reach.h"
#include "core/geometry/reach_bound.h"

namespace stellate::core {
namespace {

// The error of the oracle's tangent spaces, radians, by rounding and differences. No proof depends
// on it, whose own angles are no better.
constexpr double kHarmlessTilt = 1e-6;
// A solver may leave them wrong by this much, unnoticed. What that would explain proves nothing:
// neither that the reach is as declared, nor that it is not.
constexpr double kLikelyTilt = 1e-3;
// Larger errors of tangent spaces are found (TangentCheck).
constexpr double kUnseenTilt = 0.15;

}  // namespace

void DeclaredReach::Prove(const VertexStars& stars, const MeshShape& shape) {
  proof_ = ProveFromReach(mesh_, stars, shape, claim_);
}

void DeclaredReach::TestEdge(std::uint32_t p, std::uint32_t q, double noise) {
  const Eigen::VectorXd offset = PointOf(mesh_, q) - PointOf(mesh_, p);
  const Eigen::Map<const Eigen::MatrixXd> tangent(mesh_.Tangent(p), mesh_.d, mesh_.k);
  const double length = offset.norm();
  const double away = (offset - tangent * (tangent.transpose() * offset)).norm();
  if (!(away > 0)) return;
  TakeWitness({ReachBound(length * length, away), length, away, noise, true, {}}, [&] {
    return Message("its points ", NamePoint(PointOf(mesh_, p)), ", vertex ", p, ", and ",
                   NamePoint(PointOf(mesh_, q)));
  });
}

void DeclaredReach::TestBall(std::uint32_t v, double radius, double length, double noise) {
  if (!std::isfinite(radius)) return;
  TakeWitness({radius, length, length * length / (2 * radius), noise, true, {}}, [&] {
    return Message("a ball of that radius that touches it at vertex ", v, ", ",
                   NamePoint(PointOf(mesh_, v)), ", and again ", Brief(length), " from there");
  });
}

void DeclaredReach::TestDistance(const std::uint32_t* ids, double circumradius, double distance,
                                 double noise) {
  if (!(distance > 0)) return;
  // LargestDistance(rho, r) = distance, solved for r, in the lengths of Contradicts; a distance
  // above rho shows no more than rho itself.
  const double rho = RadiusOf(ids, circumradius), away = std::min(distance, rho);
  const double length2 = rho * rho + away * away;
  TakeWitness({ReachBound(length2, away), std::sqrt(length2), away, noise, false, {}}, [&] {
    return Message("a point of simplex ", NameSimplex(ids, mesh_.k + 1), ", which is ",
                   Brief(distance), " away from it");
  });
}

// Returns the proof's bound of the smallest ball around a simplex.
double DeclaredReach::RadiusOf(const std::uint32_t* ids, double circumradius) const {
  double longest2 = 0;
  for (int i = 0; i <= mesh_.k; ++i)
    for (int j = 0; j < i; ++j)
      longest2 =
          std::max(longest2, SquaredDistance(mesh_.Point(ids[i]), mesh_.Point(ids[j]), mesh_.d));
  return std::min(circumradius, JungRatio(mesh_.k) * std::sqrt(longest2));
}

template <typename Describe>
void DeclaredReach::TakeWitness(Witness witness, const Describe& describe) {
  const double known = witness.by_tangents ? claim_.tangent_error : 0;
  const bool unknown = witness.by_tangents && given_;
  Keep(witness, describe, known + (unknown ? kLikelyTilt : 0), &sure_);
  Keep(witness, describe, known + (unknown ? kHarmlessTilt : 0), &doubted_);
}

template <typename Describe>
void DeclaredReach::Keep(const Witness& witness, const Describe& describe, double tilt,
                         Strongest* strongest) const {
  const double left = witness.away - Blame({claim_.reach, tilt}, witness.length, witness.noise);
  const double possible = left > 0 ? ReachBound(witness.length * witness.length, left) : kInfinity;
  if (strongest->witness && !(possible < strongest->possible)) return;
  *strongest = {tilt, possible, witness};
  strongest->witness->text = describe();
}

bool DeclaredReach::Refutes(const Strongest& strongest) const {
  if (!strongest.witness) return false;
  const Witness& w = *strongest.witness;
  return Contradicts({claim_.reach, strongest.tilt}, w.length, w.away, w.noise);
}

// Returns the error of a tangent space, radians, that explains the witness.
double DeclaredReach::TiltBehind(const Witness& w) const {
  return (w.away - w.length * w.length / (2 * claim_.reach) -
          Blame({claim_.reach, 0}, w.length, w.noise)) /
         w.length;
}

// Writes the reach that the witness allows, with digits enough to differ from the declared one.
std::string DeclaredReach::SayAtMost(const Witness& w) const {
  std::string said = Message("at most ", Brief(w.reach));
  if (Brief(w.reach) == Brief(claim_.reach))
    said += Message(", less by ", Brief(claim_.reach - w.reach));
  return said;
}

void DeclaredReach::Conclude(bool covered, Findings& findings, Certificate& certificate) const {
  certificate.declared_reach = claim_.reach;
  if (Refutes(sure_)) {
    const Witness& w = *sure_.witness;
    certificate.reach_refuted = true;
    findings.Refuse(
        Findings::kDeclaredReach,
        Message("the manifold's reach is not ", Brief(claim_.reach), " as declared, but ",
                SayAtMost(w), ": see ", w.text, "; declare no more than that",
                w.by_tangents && given_ && TiltBehind(w) < kUnseenTilt
                    ? Message(" (or are tangent spaces that the oracle gives wrong by ",
                              Brief(TiltBehind(w)), " radians there?)")
                    : std::string()));
    return;
  }
  if (!proof_) return;
  if (proof_->holds && Refutes(doubted_)) {
    const Witness& w = *doubted_.witness;
    findings.Warn(Message("Not proved for the declared reach ", Brief(claim_.reach), ": ", w.text,
                          " would show that it is ", SayAtMost(w),
                          ", unless tangent spaces that the oracle gives are wrong by ",
                          Brief(TiltBehind(w)),
                          " radians there: solve for them more exactly, or "
                          "declare a little less."));
    return;
  }
  if (!proof_->holds) {
    findings.Warn(Message("Not proved for the declared reach ", Brief(claim_.reach), ": ",
                          proof_->obstacle, "."));
    return;
  }
  certificate.proved_distance = proof_->distance;
  findings.Prove(
      Message("if the manifold's reach is at least ", Brief(claim_.reach),
              ", as declared, the mesh is isotopic to ",
              covered ? "all components of the manifold that meet the bounding box"
                      : "the components of the manifold that it meets",
              ", and neither is farther than ", Brief(proof_->distance), " from the other"),
      covered);
}

}  // namespace stellate::core
