#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>

#include "core/certificate/claims/proof.h"
#include "core/certificate/findings.h"
#include "core/certificate/mesh_view.h"

namespace stellate::core {

// A reach that the client declared: proves the mesh from it, or finds what contradicts it. Each
// pair of points of M, and each point of a simplex with its closest point, bounds the reach from
// above. The strongest witness is kept: the one that leaves the smallest reach possible once all
// that wrong positions (`noise`) and wrong tangent spaces may explain is taken off.
//
//   declared.Prove(stars, shape);    // if the mesh is closed and its stars embed
//   declared.TestEdge(p, q, noise);  // and all else that bounds the reach
//   declared.Conclude(covered, findings, certificate);
class DeclaredReach {
 public:
  // `given`: the oracle gives the tangent spaces, and no bound of their error is known.
  DeclaredReach(const MeshView& mesh, const ReachClaim& claim, bool given)
      : mesh_(mesh), claim_(claim), given_(given) {}

  // Tries to prove the mesh. REQUIRES: it is closed and its stars embed.
  void Prove(const VertexStars& stars, const MeshShape& shape);

  // Tests the declared reach by vertex q, seen from vertex p.
  void TestEdge(std::uint32_t p, std::uint32_t q, double noise);
  // ... by a ball of this radius that touches M at vertex v and again at distance `length` from v;
  // lengths.
  void TestBall(std::uint32_t v, double radius, double length, double noise);
  // ... by a point at `distance` from M in a simplex with this circumradius; lengths. Tangent
  // spaces have no part in that.
  void TestDistance(const std::uint32_t* ids, double circumradius, double distance, double noise);

  // Refuses a reach that is contradicted; else says in the certificate what is proved, or why
  // nothing is. `covered`: the seeds covered the bounding box, so that every component of M in it
  // is met.
  void Conclude(bool covered, Findings& findings, Certificate& certificate) const;

 private:
  struct Witness {
    double reach = 0;             // no larger, if positions and tangents are exact
    double length = 0, away = 0;  // of Contradicts, lengths
    double noise = 0;
    bool by_tangents = false;
    std::string text;
  };
  // The strongest witness if tangent spaces may be wrong by `tilt`.
  struct Strongest {
    double tilt = 0;      // radians
    double possible = 0;  // the reach that it leaves possible
    std::optional<Witness> witness;
  };
  template <typename Describe>
  void TakeWitness(Witness witness, const Describe& describe);
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
  Strongest sure_;     // holds even if tangent spaces are as wrong as they could be
  Strongest doubted_;  // holds if tangent spaces are right
};

}  // namespace stellate::core
