#include "core/certificate/declared_reach.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/message.h"
#include "core/certificate/point_of.h"
#include "core/geometry/reach_bound.h"

namespace stellate::core {
namespace {}  // namespace

void DeclaredReach::Prove(const Stars& stars, const MeshShape& shape) {
  proof_ = ProveFromReach(mesh_, stars, shape, claim_);
}

void DeclaredReach::HoldAgainstPoint(std::uint32_t p, const Eigen::VectorXd& y) {
  const Eigen::VectorXd offset = y - PointOf(mesh_, p);
  const Eigen::Map<const Eigen::MatrixXd> tangent(mesh_.Tangent(p), mesh_.d, mesh_.k);
  const double length = offset.norm();
  const double away = (offset - tangent * (tangent.transpose() * offset)).norm();
  if (!(away > 0)) return;
  Keep({ReachBound(length * length, away), length, away,
        Message("its points ", NamePoint(PointOf(mesh_, p)), ", vertex ", p, ", and ",
                NamePoint(y))});
}

void DeclaredReach::HoldAgainstEdge(std::uint32_t p, std::uint32_t q) {
  HoldAgainstPoint(p, PointOf(mesh_, q));
}

void DeclaredReach::HoldAgainstBall(std::uint32_t v, double radius, double length) {
  if (!std::isfinite(radius)) return;
  Keep({radius, length, length * length / (2 * radius),
        Message("a ball of that radius that touches it at vertex ", v, ", ",
                NamePoint(PointOf(mesh_, v)), ", and again ", Brief(length), " from there")});
}

void DeclaredReach::HoldAgainstDistance(const std::uint32_t* ids, double circumradius,
                                        double distance) {
  if (!(distance > 0)) return;
  // LargestDistance(circumradius, r) = distance, solved for r, in the lengths of Contradicts; no
  // distance above the circumradius says more than that one.
  const double away = std::min(distance, circumradius);
  const double length2 = circumradius * circumradius + away * away;
  Keep({ReachBound(length2, away), std::sqrt(length2), away,
        Message("a point of simplex ", NameSimplex(ids, mesh_.k + 1), ", which is ",
                Brief(distance), " away from it")});
}

void DeclaredReach::Keep(Witness witness) {
  if (!narrowest_ || witness.reach < narrowest_->reach) narrowest_ = std::move(witness);
}

bool DeclaredReach::IsRefuted(double noise) const {
  return narrowest_ && Contradicts(claim_, narrowest_->length, narrowest_->away, noise);
}

void DeclaredReach::Conclude(double noise, bool covered, Findings& findings,
                             Certificate& certificate) const {
  certificate.declared_reach = claim_.reach;
  if (IsRefuted(noise)) {
    certificate.reach_refuted = true;
    findings.Refuse(Findings::kDeclaredReach,
                    Message("the manifold's reach is not ", Brief(claim_.reach),
                            " as declared, but at most ", Brief(narrowest_->reach), ": see ",
                            narrowest_->text, "; declare no more than that"));
    return;
  }
  if (!proof_) return;
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
