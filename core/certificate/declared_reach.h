#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>

#include "core/certificate/findings.h"
#include "core/certificate/mesh_view.h"
#include "core/certificate/proof.h"

namespace stellate::core {

// A reach that the client declared: what is proved from it, and what contradicts it. Each pair of
// points of M, and each point of a simplex with its closest point, bounds the reach from above; the
// one that bounds it most is kept.
class DeclaredReach {
 public:
  DeclaredReach(const MeshView& mesh, const ReachClaim& claim) : mesh_(mesh), claim_(claim) {}

  // The mesh is closed and its stars embed.
  void Prove(const Stars& stars, const MeshShape& shape);

  // The point y of M, seen from vertex p.
  void HoldAgainstPoint(std::uint32_t p, const Eigen::VectorXd& y);
  // Two vertices p and q, the same.
  void HoldAgainstEdge(std::uint32_t p, std::uint32_t q);
  // A ball of this radius touches M at vertex v and, at this distance from it, again; lengths.
  void HoldAgainstBall(std::uint32_t v, double radius, double length);
  // A point of a simplex with this circumradius, length, is `distance` away from M.
  void HoldAgainstDistance(const std::uint32_t* ids, double circumradius, double distance);

  // `noise`: how wrong the oracle's points were seen to be, length. `covered`: every component of M
  // within the bounding box was asked for. Refuses a reach that is contradicted; else says in the
  // certificate what is proved, or why nothing is.
  void Conclude(double noise, bool covered, Findings& findings, Certificate& certificate) const;

 private:
  struct Witness {
    double reach = 0;             // no larger, if positions and tangents are exact
    double length = 0, away = 0;  // of Contradicts, lengths
    std::string text;
  };
  void Keep(Witness witness);
  bool IsRefuted(double noise) const;

  const MeshView mesh_;
  const ReachClaim claim_;
  std::optional<Proof> proof_;
  std::optional<Witness> narrowest_;
};

}  // namespace stellate::core
