#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/batch.h"
#include "core/certificate/claims/examination.h"

namespace stellate::core {

// Of manifolds with boundary: that the mesh ends where its faces are, and only there. The boundary
// is closed off by cones to one vertex more; the mesh is a manifold with boundary when what then
// comes out is closed and its links, but that vertex', are spheres: the link of a vertex of the
// boundary is a ball exactly when, with its rim coned off, it is a sphere.
class BoundaryClaims {
 public:
  explicit BoundaryClaims(Examination& examination) : x_(examination) {}

  // The simplices and the cones over the boundary's, K+1 ascending ids each. The vertex that closes
  // it off is the last, examination.mesh.vertices.
  static std::vector<std::uint32_t> CloseOff(const MeshView& mesh);
  // What is told of each face; and that the boundary itself is a closed manifold.
  void JudgeFaces();

  // Barycentres of some simplices of the boundary, a block for each wall; and the answers to one.
  std::vector<QueryBlock> FaceQuestions();
  void JudgeFace(std::size_t block, const Eigen::MatrixXd& asked, const AnswerBlock& answer);
  // That no simplex lies beyond a wall that it does not touch. `chosen`, `each`: see PointsInside.
  void JudgeInside(const std::vector<std::uint32_t>& chosen, std::uint32_t each,
                   const AnswerBlock& answer);
  // Of points of M^: where one near the mesh is beyond a wall that the mesh does not end at.
  void JudgeBeyond(const AnswerBlock& answer);
  // Takes a point of the wall that was answered, d, beside that simplex of its mesh, k ids: what it
  // shows of the boundary's reach. After the oracle's error is known.
  void HoldPoint(int wall, const std::uint32_t* ids, const double* y);
  // That the boundary's own reach within M, as its edges and answers show it, is not too small for
  // the mesh. After M's own reach is known.
  void JudgeReach();

 private:
  void HoldAt(WallSet walls, std::uint32_t p, const double* q);

  Examination& x_;
  std::vector<std::vector<std::uint32_t>> chosen_;  // by block: places in its face
  std::vector<const FaceMesh*> faces_;              // by block
  // What was seen of the boundary's reach: the least, at which vertex, and of which wall; and the
  // largest share that the mesh size is of it.
  double reach_ = INFINITY, ratio_ = 0;
  std::uint32_t narrowest_ = 0;
  WallSet narrowest_walls_ = 0;
};

}  // namespace stellate::core
