#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>

#include "core/certificate/claims/proof.h"
#include "core/certificate/findings.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// A reach that the client declared: what is proved from it, and what contradicts it. Each pair of
// points of M, and each point of a simplex with its closest point, bounds the reach from above. Of
// these the one is kept that leaves the smallest reach possible, once all that it may owe to wrong
// positions, `noise`, and to wrong tangent spaces is taken off.
class DeclaredReach {
 public:
  // `given`: the tangent spaces are the oracle's, and no bound of their error is known.
  DeclaredReach(const MeshView& mesh, const ReachClaim& claim, bool given)
      : mesh_(mesh), claim_(claim), given_(given) {}

  // The mesh is closed and its stars embed.
  void Prove(const VertexStars& stars, const MeshShape& shape);

  // Two vertices p and q, q as it is seen from p.
  void TestEdge(std::uint32_t p, std::uint32_t q, double noise);
  // A ball of this radius touches M at vertex v and, at this distance from it, again; lengths.
  void TestBall(std::uint32_t v, double radius, double length, double noise);
  // A point of a simplex with this circumradius, length, is `distance` away from M: no tangent
  // space has a part in that.
  void TestDistance(const std::uint32_t* ids, double circumradius, double distance, double noise);

  // `covered`: every component of M within the bounding box was asked for. Refuses a reach that is
  // contradicted; else says in the certificate what is proved, or why nothing is.
  void Conclude(bool covered, Findings& findings, Certificate& certificate) const;

 private:
  struct Witness {
    double reach = 0;             // no larger, if positions and tangents are exact
    double length = 0, away = 0;  // of Contradicts, lengths
    double noise = 0;
    bool by_tangents = false;
    std::string text;
  };
  // The strongest witness, where tangent spaces may be wrong by `tilt`.
  struct Strongest {
    double tilt = 0;      // radians
    double possible = 0;  // the reach that it leaves possible
    std::optional<Witness> witness;
  };
  template <typename Describe>
  void Hold(Witness witness, const Describe& describe);
  template <typename Describe>
  void Keep(const Witness& witness, const Describe& describe, double tilt,
            Strongest* strongest) const;
  bool Refutes(const Strongest& strongest) const;
  double TiltBehind(const Witness& witness) const;
  std::string SayAtMost(const Witness& witness) const;
  double RadiusOf(const std::uint32_t* ids, double circumradius) const;

  const MeshView mesh_;
  const ReachClaim claim_;
  const bool given_;
  std::optional<Proof> proof_;
  Strongest sure_;     // whatever tangent spaces could be to blame for
  Strongest doubted_;  // unless they are
};

}  // namespace stellate::core
